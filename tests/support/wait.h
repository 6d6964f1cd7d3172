/** \file
 * Waiting for what another thread or program does. */
#pragma once

#include <poll.h>

#include <chrono>

namespace raceloc::test {

/** Whether a condition comes true, asked again and again for at most `limit`, which is far beyond what it takes. */
template <class Condition>
bool comesTrue(const Condition& condition, std::chrono::seconds limit = std::chrono::seconds(60)) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    constexpr int kBetween_ms = 2;  // leaves the cores to those who are waited for
    poll(nullptr, 0, kBetween_ms);
  }
  return true;
}

}  // namespace raceloc::test
