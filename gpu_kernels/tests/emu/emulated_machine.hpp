/** \file
 * The machine of kernels/device_backend.hpp as fibres. Sort and sum, which CUDA takes from CUB, are the standard
 * library's. */
#pragma once

#include <algorithm>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "kernels/device_backend.hpp"

namespace raceloc::gpu::emu {

/** As large as asked for and full of NaN, so that a sanitizer sees a step beyond the end, and a test a value that
 * nobody wrote. */
template <class T>
class Array {
 public:
  T* room(std::size_t n) {
    if (n > x_size) {
      x_data.reset(new T[n]);
      x_size = n;
    }
    if (n > 0) std::memset(static_cast<void*>(x_data.get()), 0xFF, x_size * sizeof(T));
    return x_data.get();
  }
  template <class Machine>
  const T* upload(Machine&, std::initializer_list<const T*> rows, std::size_t n) {
    T* data = room(rows.size() * n);
    T* to = data;
    for (const T* row : rows) to = std::copy(row, row + n, to);
    return data;
  }
  template <class Machine>
  void download(Machine&, std::size_t n, std::size_t from = 0) {
    x_host.assign(x_data.get() + from, x_data.get() + from + n);
  }
  [[nodiscard]] T* data() const { return x_data.get(); }
  [[nodiscard]] const T* host() const { return x_host.data(); }

 private:
  std::unique_ptr<T[]> x_data;
  std::size_t x_size = 0;
  std::vector<T> x_host;
};

class Machine {
 public:
  template <class T>
  using Array = emu::Array<T>;
  template <class T>
  using HostArray = emu::Array<T>;

  /** \param seed  of the order of threads; takes the place of a device's number */
  explicit Machine(int seed) : x_seed(seed) {}

  [[nodiscard]] int device() const { return x_seed; }
  [[nodiscard]] std::string description() const { return "emulator, seed " + std::to_string(x_seed); }
  void select() const {}
  void wait() const {}
  void mark() const {}
  void waitForMark() const {}

  template <class... Parameters, class... Arguments>
  void launch(const char* name, simt::Grid blocks, int threads, void (*kernel)(Parameters...),
              const Arguments&... arguments) {
    const auto seed = static_cast<std::uint64_t>(x_seed) << 32 | x_launches++;
    emu::launch(name, blocks, threads, seed, [&] { kernel(arguments...); });
  }

  template <class Key>
  void sortPairs(SortBuffers<Machine>& b, std::uint32_t n, int bits) {
    const Key mask =
        static_cast<Key>(bits < std::numeric_limits<Key>::digits ? (Key{1} << bits) - 1 : ~Key{0});
    std::vector<std::uint32_t> from(n);
    std::iota(from.begin(), from.end(), 0U);
    const Key* keys = b.keys<Key>().mixed.data();
    std::stable_sort(from.begin(), from.end(),
                     [&](auto i, auto j) { return (keys[i] & mask) < (keys[j] & mask); });
    Key* keys_sorted = b.keys<Key>().sorted.room(n);
    std::uint32_t* order_sorted = b.order_sorted.room(n);
    for (std::uint32_t k = 0; k < n; ++k) {
      keys_sorted[k] = keys[from[k]];
      order_sorted[k] = b.order.data()[from[k]];
    }
  }
  template <class Key>
  void numberRuns(SortBuffers<Machine>& b, const SortedKeys<Key>& sorted) {
    std::uint32_t* numbers = b.numbers.room(sorted.size);
    for (std::uint32_t k = 0; k < sorted.size; ++k) numbers[k] = sorted(k) + (k == 0 ? 0 : numbers[k - 1]);
  }
  void numberFlags(SortBuffers<Machine>& b, std::uint32_t n) {
    std::partial_sum(b.flags.data(), b.flags.data() + n, b.numbers.room(n));
  }

 private:
  int x_seed;
  std::uint32_t x_launches = 0;
};

}  // namespace raceloc::gpu::emu
