/** \file
 * Runs kernels on the CPU to test what the CPU's loops cannot show: a fibre a GPU thread, which gives way at
 * every barrier, shuffle, fence and atomic; threads and blocks take turns in an order drawn from a seed, a few
 * blocks at a time. Shared memory begins as NaN. A barrier or shuffle that not all threads of the block or warp
 * reach at one place is an error. It shows no race within a step, no memory order and no time.
 * Included by kernels/simt.hpp alone. */
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <utility>

#define RACELOC_KERNEL(threads) static inline void  // static: the CUDA build has a function of this name
#define RACELOC_DEVICE inline
#define RACELOC_UNROLL
// NOLINTBEGIN(bugprone-macro-parentheses): a type and a name
/** The address of `tag` names the variable: each instance of a template has its own. */
#define RACELOC_SHARED(type, name)  \
  static const char name##_tag = 0; \
  type& name = *static_cast<type*>(::raceloc::gpu::emu::sharedMemory(&name##_tag, sizeof(type)))
// NOLINTEND(bugprone-macro-parentheses)

namespace raceloc::gpu::emu {

/** "kernel at file:line: what is wrong" */
class KernelError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/** Where a kernel waits. */
struct Place {
  const char* file;
  int line;
};

/** Runs `kernel` once for each thread. \throws KernelError; what the kernel throws */
void launch(const char* name, simt::Grid grid, int threads, std::uint64_t seed,
            const std::function<void()>& kernel);

// What a running kernel asks for.
struct Coordinates {
  simt::Grid block, blocks;
  std::uint32_t thread, threads;
};
[[nodiscard]] const Coordinates& coordinates();
void waitForBlock(Place place);
[[nodiscard]] double exchange(double value, int mask, Place place);
void giveWay();
[[nodiscard]] void* sharedMemory(const void* tag, std::size_t bytes);

}  // namespace raceloc::gpu::emu

namespace raceloc::gpu::simt {

inline std::uint32_t thread() { return emu::coordinates().thread; }
inline std::uint32_t threads() { return emu::coordinates().threads; }
inline Grid block() { return emu::coordinates().block; }
inline Grid blocks() { return emu::coordinates().blocks; }
inline void barrier(const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  emu::waitForBlock({file, line});
}
/** Of a number that a double holds. */
template <class T>
T fromLaneXor(T value, int mask, const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  return static_cast<T>(emu::exchange(static_cast<double>(value), mask, {file, line}));
}
inline void fence() { emu::giveWay(); }
inline std::uint32_t increment(std::uint32_t& counter) {
  emu::giveWay();
  return counter++;
}
template <class T>
T fromOtherBlock(const T& value) {
  return value;
}
inline std::uint32_t exchangeIf(std::uint32_t& place, std::uint32_t expected, std::uint32_t value) {
  emu::giveWay();
  return place == expected ? std::exchange(place, value) : place;
}

}  // namespace raceloc::gpu::simt
