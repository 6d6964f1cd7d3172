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

struct DeviceMemory {
  static void* take(std::size_t bytes) {
    void* data = nullptr;
    checkCuda(cudaMalloc(&data, bytes), "cudaMalloc");
    return data;
  }
  static void give(void* data) { checkCuda(cudaFree(data), "cudaFree"); }
};

struct PinnedMemory {
  static void* take(std::size_t bytes) {
    void* data = nullptr;
    checkCuda(cudaMallocHost(&data, bytes), "cudaMallocHost");
    return data;
  }
  static void give(void* data) { checkCuda(cudaFreeHost(data), "cudaFreeHost"); }
};

/** Memory that grows and never shrinks: a context's buffers live as long as it does. */
template <class T, class Memory>
class GrowingArray {
 public:
  GrowingArray() = default;
  ~GrowingArray() {
    try {
      Memory::give(x_data);
    } catch (const DeviceError&) {  // the driver is gone, and its memory with it
    }
  }
  GrowingArray(const GrowingArray&) = delete;
  GrowingArray& operator=(const GrowingArray&) = delete;

  /** Room for n elements; what was there is lost if it has to grow. */
  T* room(std::size_t n) {
    if (n > x_capacity) {
      Memory::give(x_data);
      x_data = nullptr, x_capacity = 0;
      x_data = static_cast<T*>(Memory::take(n * sizeof(T))), x_capacity = n;
    }
    return x_data;
  }
  [[nodiscard]] T* data() const { return x_data; }

 private:
  T* x_data = nullptr;
  std::size_t x_capacity = 0;
};

/** Memory of the host that the device reads and writes in place (pinned; host and device share its address). */
template <class T>
using PinnedArray = GrowingArray<T, PinnedMemory>;

/** Memory on the device. Copies go through pinned memory, which the device reads while the host does something else. */
template <class T>
class DeviceArray {
 public:
  T* room(std::size_t n) { return x_memory.room(n); }

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
    checkCuda(cudaMemcpyAsync(x_pinned.room(n), data() + from, n * sizeof(T), cudaMemcpyDeviceToHost,
                              machine.stream()),
              "cudaMemcpyAsync to the host");
  }

  [[nodiscard]] T* data() const { return x_memory.data(); }
  [[nodiscard]] const T* host() const { return x_pinned.data(); }

 private:
  /** Worth a copy of its own, which runs while the next rows are staged. */
  static constexpr std::size_t kCopyBytes = std::size_t{128} * 1024;

  GrowingArray<T, DeviceMemory> x_memory;
  PinnedArray<T> x_pinned;
};

}  // namespace raceloc::gpu
