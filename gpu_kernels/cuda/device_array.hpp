/** \file
 * Device memory with an owner, its pinned twin on the host, and driver calls that cannot fail unseen. */
#pragma once

#include <cuda_runtime_api.h>

#include <cstring>
#include <initializer_list>
#include <string>

#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** A call of the driver, and where it stands: built at the call from its name alone. */
struct CudaCall {
  const char* name;
  const char* file;
  int line;
  CudaCall(const char* name_, const char* file_ = __builtin_FILE(), int line_ = __builtin_LINE())
      : name(name_), file(file_), line(line_) {}
};

/** \throws DeviceError "call at file:line: the driver's words" */
inline void checkCuda(cudaError_t status, const CudaCall& call) {
  if (status == cudaSuccess) return;
  cudaGetLastError();  // the error would stick to the next call
  const char* slash = std::strrchr(call.file, '/');
  throw DeviceError(std::string(call.name) + " at " + (slash == nullptr ? call.file : slash + 1) + ":" +
                    std::to_string(call.line) + ": " + cudaGetErrorString(status));
}

/** Memory of the host that the device reads and writes in place (pinned; host and device share its address); it grows
 * and never shrinks. */
template <class T>
class PinnedArray {
 public:
  PinnedArray() = default;
  ~PinnedArray() { cudaFreeHost(x_data); }
  PinnedArray(const PinnedArray&) = delete;
  PinnedArray& operator=(const PinnedArray&) = delete;

  /** Room for n elements; what was there is lost if it has to grow. */
  T* room(std::size_t n) {
    if (n > x_capacity) {
      checkCuda(cudaFreeHost(x_data), "cudaFreeHost");
      x_data = nullptr, x_capacity = 0;
      void* data = nullptr;
      checkCuda(cudaMallocHost(&data, n * sizeof(T)), "cudaMallocHost");
      x_data = static_cast<T*>(data), x_capacity = n;
    }
    return x_data;
  }
  [[nodiscard]] const T* data() const { return x_data; }

 private:
  T* x_data = nullptr;
  std::size_t x_capacity = 0;
};

/** Memory on the device that grows and never shrinks: a context's buffers live as long as it does. Copies go
 * through pinned memory, which the device reads while the host does something else. */
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
      checkCuda(cudaFree(x_data), "cudaFree");
      x_data = nullptr, x_capacity = 0;
      void* data = nullptr;
      checkCuda(cudaMalloc(&data, n * sizeof(T)), "cudaMalloc");
      x_data = static_cast<T*>(data), x_capacity = n;
    }
    return x_data;
  }

  /** Rows of n elements, one behind the other. The copy before from or to this array must have ended. */
  template <class Machine>
  const T* upload(const Machine& machine, std::initializer_list<const T*> rows, std::size_t n) {
    const std::size_t total = rows.size() * n;
    T* data = room(total);
    if (total == 0) return data;
    T* staged = x_pinned.room(total);
    std::size_t filled = 0, sent = 0;
    for (const T* row : rows) {
      std::memcpy(staged + filled, row, n * sizeof(T));
      filled += n;
      if (filled < total && (filled - sent) * sizeof(T) < kCopyBytes) continue;
      checkCuda(cudaMemcpyAsync(data + sent, staged + sent, (filled - sent) * sizeof(T),
                                cudaMemcpyHostToDevice, machine.stream()),
                "cudaMemcpyAsync to the device");
      sent = filled;
    }
    return data;
  }

  /** Elements [from, from + n) are at host() when the stream has been waited for. */
  template <class Machine>
  void download(const Machine& machine, std::size_t n, std::size_t from = 0) {
    if (n == 0) return;
    checkCuda(cudaMemcpyAsync(x_pinned.room(n), x_data + from, n * sizeof(T), cudaMemcpyDeviceToHost,
                              machine.stream()),
              "cudaMemcpyAsync to the host");
  }

  [[nodiscard]] T* data() const { return x_data; }
  [[nodiscard]] const T* host() const { return x_pinned.data(); }

 private:
  /** Worth a copy of its own, which runs while the next rows are staged. */
  static constexpr std::size_t kCopyBytes = std::size_t{128} * 1024;

  T* x_data = nullptr;
  std::size_t x_capacity = 0;
  PinnedArray<T> x_pinned;
};

}  // namespace raceloc::gpu
