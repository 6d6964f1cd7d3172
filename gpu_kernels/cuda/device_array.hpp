/** \file
 * Device memory with an owner, and driver calls that cannot fail unseen. */
#pragma once

#include <cuda_runtime_api.h>

#include <string>
#include <utility>
#include <vector>

#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** \throws DeviceError "call: the driver's words" */
inline void checkCuda(cudaError_t status, const char* call) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // the error would stick to the next call
  throw DeviceError(std::string(call) + ": " + cudaGetErrorString(status));
}

/** Memory on the device that grows and never shrinks: a context's buffers live as long as it does. */
template <class T>
class DeviceArray {
 public:
  DeviceArray() = default;
  ~DeviceArray() { cudaFree(x_data); }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;

  /** Room for n elements; what was there is lost if it has to grow. */
  T* room(std::size_t n) {
    if (n > x_capacity) {
      cudaFree(x_data);
      x_data = nullptr, x_capacity = 0;
      void* data = nullptr;
      checkCuda(cudaMalloc(&data, n * sizeof(T)), "cudaMalloc");
      x_data = static_cast<T*>(data), x_capacity = n;
    }
    return x_data;
  }

  const T* upload(const T* host, std::size_t n, cudaStream_t stream) {
    T* data = room(n);
    if (n > 0)
      checkCuda(cudaMemcpyAsync(data, host, n * sizeof(T), cudaMemcpyHostToDevice, stream),
                "cudaMemcpyAsync");
    return data;
  }

  void download(T* host, std::size_t n, cudaStream_t stream) const {
    if (n > 0)
      checkCuda(cudaMemcpyAsync(host, x_data, n * sizeof(T), cudaMemcpyDeviceToHost, stream),
                "cudaMemcpyAsync");
  }

  [[nodiscard]] T* data() const { return x_data; }

 private:
  T* x_data = nullptr;
  std::size_t x_capacity = 0;
};

}  // namespace raceloc::gpu
