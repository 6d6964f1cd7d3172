/** \file
 * Which device the kernels run on. */
#pragma once

#include <memory>
#include <string>

namespace raceloc::gpu {

enum class Backend { automatic, cpu, cuda };

class BackendBase;  // one of cpu/, cuda/, cuda_stub/

/** Owns a device's stream and buffers; one thread at a time uses a context. Movable, cheap to pass by
 * reference. */
class Context {
 public:
  /** `automatic` takes CUDA when it was built in, a device of capability 7.5 or newer answers and computes
   * what the CPU does (see passesSelfTest()); else the CPU. The environment variable RACELOC_BACKEND (auto, cpu,
   * cuda) overrides `backend`. \param threads  of the CPU backend, >= 1; they change no bit of a result
   * \param device   number of the CUDA device
   * \throws std::invalid_argument for another number of threads; DeviceError if `cuda` is asked for and cannot be
   * had. */
  explicit Context(Backend backend = Backend::automatic, int device = 0, int threads = 1);
  ~Context();
  Context(Context&&) noexcept;
  Context& operator=(Context&&) noexcept;

  [[nodiscard]] Backend backend() const;            ///< cpu or cuda, never automatic
  [[nodiscard]] const std::string& reason() const;  ///< one line: why this backend, for the log

  /** Takes a built-in pair of scans through all kernels, some milliseconds, and compares with the CPU. Where a
   * GPU differs, the context goes on with the CPU's kernels, and reason() says why. \return false if it did */
  bool passesSelfTest();

  [[nodiscard]] BackendBase& implementation() const { return *x_backend; }

 private:
  std::unique_ptr<BackendBase> x_backend;
  std::string x_reason;
  int x_threads;
};

}  // namespace raceloc::gpu
