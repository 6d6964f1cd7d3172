/** \file
 * Tests that run on the CPU and, where a device answers, on CUDA. */
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <optional>

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu::test {

class OnEachDevice : public ::testing::TestWithParam<Backend> {
 protected:
  void SetUp() override {
    ::unsetenv("RACELOC_BACKEND");  // the parameter decides here
    try {
      x_context.emplace(GetParam());
    } catch (const DeviceError& reason) {
      GTEST_SKIP() << reason.what();
    }
  }
  Context& context() {
    return *x_context;
  }  // NOLINT(bugprone-unchecked-optional-access): SetUp() skips without one

 private:
  std::optional<Context> x_context;
};

inline std::string deviceName(const ::testing::TestParamInfo<Backend>& info) {
  return info.param == Backend::cpu ? "cpu" : "cuda";
}

}  // namespace raceloc::gpu::test
