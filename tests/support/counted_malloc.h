/** \file
 * Counts calls of malloc, which `new` and Eigen make as well. It replaces malloc: for one source of a program of its own. */
#pragma once

#include <atomic>
#include <cstdlib>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define RACELOC_OTHER_MALLOC  // the sanitizer's: not to be replaced
#endif

namespace {
std::atomic<long> allocations{0};
}

#ifndef RACELOC_OTHER_MALLOC
extern "C" void* __libc_malloc(std::size_t bytes);  // NOLINT(bugprone-reserved-identifier): glibc's own
extern "C" void* malloc(std::size_t bytes) {
  ++allocations;
  return __libc_malloc(bytes);
}
#endif
