/** \file
 * Threads of the CPU backend. What is computed does not depend on how many there are: work is cut into the
 * same pieces, and what pieces leave behind is added up in their order. */
#pragma once

#include <algorithm>
#include <cstddef>
#if defined(GK_WITH_TBB)
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#endif
#if defined(__SSE2__)
#include <pmmintrin.h>
#include <xmmintrin.h>
#endif

namespace raceloc::gpu {

/** Denormal floats count as 0 within a scope: the last Jacobi products are denormal, and slow. */
class FlushDenormals {
#if defined(__SSE2__)
 public:
  FlushDenormals() : x_before(_mm_getcsr()) {
    _mm_setcsr(x_before | _MM_FLUSH_ZERO_ON | _MM_DENORMALS_ZERO_ON);
  }
  ~FlushDenormals() { _mm_setcsr(x_before); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned x_before;
#else
 public:
  FlushDenormals() {}
#endif
};

class Workers {
 public:
#if defined(GK_WITH_TBB)
  explicit Workers(int threads) : x_threads(threads), x_arena(threads) {}
#else
  explicit Workers(int) : x_threads(1) {}
#endif

  [[nodiscard]] int threads() const { return x_threads; }

  /** Calls `work(begin, end, worker)` for the pieces of [0, n), each `piece` long, 0 <= worker < threads(),
   * in any order, and returns when all are done. */
  template <class Work>
  void forPieces(std::size_t n, std::size_t piece, const Work& work) {
    const std::size_t pieces = (n + piece - 1) / piece;
    const auto one = [&](std::size_t k, int worker) {
      const FlushDenormals flush;
      work(k * piece, std::min(n, (k + 1) * piece), worker);
    };
#if defined(GK_WITH_TBB)
    if (x_threads > 1 && pieces > 1) {
      x_arena.execute([&] {
        tbb::parallel_for(
            std::size_t{0}, pieces,
            [&](std::size_t k) { one(k, tbb::this_task_arena::current_thread_index()); },
            tbb::simple_partitioner());
      });
      return;
    }
#endif
    for (std::size_t k = 0; k < pieces; ++k) one(k, 0);
  }

 private:
  int x_threads;
#if defined(GK_WITH_TBB)
  tbb::task_arena x_arena;
#endif
};

}  // namespace raceloc::gpu
