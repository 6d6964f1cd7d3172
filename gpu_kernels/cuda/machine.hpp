/** \file
 * The machine of kernels/device_backend.hpp as a CUDA device. */
#pragma once

#include <cuda_runtime_api.h>

#include <string>
#include <utility>

#include "cuda/device_array.hpp"
#include "kernels/simt.hpp"
#include "kernels/sort_buffers.hpp"

namespace raceloc::gpu {

class CudaMachine {
 public:
  template <class T>
  using Array = DeviceArray<T>;
  template <class T>
  using HostArray = PinnedArray<T>;

  explicit CudaMachine(int device) : x_device(device) {
    select();
    checkCuda(cudaStreamCreateWithFlags(&x_stream, cudaStreamNonBlocking), "cudaStreamCreateWithFlags");
    checkCuda(cudaEventCreateWithFlags(&x_mark, cudaEventDisableTiming), "cudaEventCreateWithFlags");
  }
  ~CudaMachine() {
    cudaEventDestroy(x_mark);
    cudaStreamDestroy(x_stream);
  }
  CudaMachine(const CudaMachine&) = delete;
  CudaMachine& operator=(const CudaMachine&) = delete;

  [[nodiscard]] int device() const { return x_device; }
  [[nodiscard]] std::string description() const;
  [[nodiscard]] cudaStream_t stream() const { return x_stream; }
  void select() const { checkCuda(cudaSetDevice(x_device), "cudaSetDevice"); }
  void wait() const { checkCuda(cudaStreamSynchronize(x_stream), "cudaStreamSynchronize"); }

  void mark() const { checkCuda(cudaEventRecord(x_mark, x_stream), "cudaEventRecord"); }
  void waitForMark() const { checkCuda(cudaEventSynchronize(x_mark), "cudaEventSynchronize"); }

  template <class... Parameters, class... Arguments>
  void launch(const CudaCall& name, simt::Grid blocks, int threads, void (*kernel)(Parameters...),
              const Arguments&... arguments) {
    kernel<<<dim3(blocks.x, blocks.y), static_cast<unsigned>(threads), 0, x_stream>>>(arguments...);
    checkCuda(cudaGetLastError(), name);
  }

  template <class Key>
  void sortPairs(SortBuffers<CudaMachine>& buffers, std::uint32_t n, int bits);
  template <class Key>
  void numberRuns(SortBuffers<CudaMachine>& buffers, const SortedKeys<Key>& sorted);
  void numberFlags(SortBuffers<CudaMachine>& buffers, std::uint32_t n);

 private:
  int x_device;
  cudaStream_t x_stream = nullptr;
  cudaEvent_t x_mark = nullptr;
};

}  // namespace raceloc::gpu
