#include "raceloc/gpu/context.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include "raceloc/gpu/types.h"

namespace raceloc::gpu {
namespace {

class Environment : public ::testing::Test {
 protected:
  void SetUp() override { ::unsetenv("RACELOC_BACKEND"); }
  void TearDown() override { ::unsetenv("RACELOC_BACKEND"); }
};

TEST_F(Environment, AutomaticSaysWhichBackendAndWhy) {
  const Context context;
  EXPECT_NE(context.backend(), Backend::automatic);
  EXPECT_GT(context.reason().size(), std::string("CPU, one thread: ").size());
  EXPECT_EQ(context.reason().find('\n'), std::string::npos);
}

TEST_F(Environment, CudaIsThereOrAnError) {
  try {
    EXPECT_EQ(Context(Backend::cuda).backend(), Backend::cuda);
  } catch (const DeviceError& reason) {
    EXPECT_NE(std::string(reason.what()), "");
    EXPECT_NE(Context().reason().find(reason.what()),
              std::string::npos);  // automatic falls back with the same words
  }
  EXPECT_THROW(Context(Backend::cuda, -1), DeviceError);
  EXPECT_THROW(Context(Backend::cuda, 1000), DeviceError);
}

TEST_F(Environment, OverridesTheArgument) {
  ::setenv("RACELOC_BACKEND", "cpu", 1);
  EXPECT_EQ(Context(Backend::cuda, 1000).backend(), Backend::cpu);
  ::setenv("RACELOC_BACKEND", "cuda", 1);
  EXPECT_THROW(Context(Backend::cpu, 1000), DeviceError);
  ::setenv("RACELOC_BACKEND", "gpu", 1);
  EXPECT_THROW(Context{Backend::cpu}, std::invalid_argument);
  ::setenv("RACELOC_BACKEND", "", 1);
  EXPECT_EQ(Context(Backend::cpu).backend(), Backend::cpu);
}

TEST_F(Environment, AContextMoves) {
  Context from(Backend::cpu);
  const BackendBase* backend = &from.implementation();
  const Context to(std::move(from));
  EXPECT_EQ(&to.implementation(), backend);
}

}  // namespace
}  // namespace raceloc::gpu
