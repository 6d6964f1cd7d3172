#include "raceloc/gpu/context.h"

#include <cstdlib>
#include <string_view>

#include "api/check.hpp"
#include "api/self_test.hpp"
#include "core/backend.hpp"

namespace raceloc::gpu {

namespace {

/** What RACELOC_BACKEND says; `asked` without it. */
Backend overridden(Backend asked, bool& by_environment) {
  const char* value = std::getenv("RACELOC_BACKEND");
  by_environment = value != nullptr && *value != '\0';
  if (!by_environment) return asked;
  const std::string_view name = value;
  if (name == "auto") return Backend::automatic;
  if (name == "cpu") return Backend::cpu;
  if (name == "cuda") return Backend::cuda;
  throw std::invalid_argument("RACELOC_BACKEND is '" + std::string(name) +
                              "', but must be auto, cpu or cuda");
}

}  // namespace

Context::Context(Backend backend, int device, int threads) : x_threads(threads) {
  require(threads >= 1 && threads <= 256, "threads", threads, "from 1 to 256");
  bool by_environment = false;
  const Backend wanted = overridden(backend, by_environment);
  const std::string who = by_environment ? "RACELOC_BACKEND asks for it" : "it was asked for";
  switch (wanted) {
    case Backend::cpu:
      x_backend = makeCpuBackend(threads);
      x_reason = x_backend->description() + ": " + who;
      return;
    case Backend::cuda:
      x_backend = makeCudaBackend(device);
      if (!passesSelfTest()) throw DeviceError(x_reason);
      x_reason = x_backend->description() + ": " + who;
      return;
    case Backend::automatic:
      break;
  }
  try {
    x_backend = makeCudaBackend(device);
    if (passesSelfTest()) x_reason = x_backend->description() + ": it answers and computes what the CPU does";
  } catch (const DeviceError& no_cuda) {
    x_backend = makeCpuBackend(threads);
    x_reason = x_backend->description() + ": " + no_cuda.what();
  }
}

bool Context::passesSelfTest() {
  if (backend() == Backend::cpu) return true;
  const std::string difference = selfTest(*x_backend);
  if (difference.empty()) return true;
  const std::string failed = x_backend->description() + " failed its self-test: " + difference;
  x_backend = makeCpuBackend(x_threads);
  x_reason = x_backend->description() + ": " + failed;
  return false;
}

Context::~Context() = default;
Context::Context(Context&&) noexcept = default;
Context& Context::operator=(Context&&) noexcept = default;

Backend Context::backend() const { return x_backend->kind(); }
const std::string& Context::reason() const { return x_reason; }

}  // namespace raceloc::gpu
