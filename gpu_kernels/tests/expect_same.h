#pragma once

#include <gtest/gtest.h>

#include "raceloc/gpu/types.h"

namespace raceloc::gpu::test {

inline void expectSamePoints(const Points& a, const Points& b) {
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.y, b.y);
  EXPECT_EQ(a.z, b.z);
}

}  // namespace raceloc::gpu::test
