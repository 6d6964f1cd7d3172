/** \file
 * Laws over many seeds: `forAll(200, [](Random& rnd) { ... })` prints the seed of a failure. */
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <initializer_list>
#include <iterator>
#include <random>

#include "core/types.h"

namespace raceloc::test {

class Random {
 public:
  explicit Random(unsigned seed) : x_engine(seed) {}
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(x_engine);
  }
  double normal(double sigma = 1) { return std::normal_distribution<double>(0, sigma)(x_engine); }
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(x_engine); }
  template <class T>
  T oneOf(std::initializer_list<T> values) {
    return *std::next(values.begin(), integer(0, static_cast<int>(values.size()) - 1));
  }
  Eigen::Vector3d vectorWithin(double size) {
    return {uniform(-size, size), uniform(-size, size), uniform(-size, size)};
  }
  /** Rotation up to `angle_rad` about any axis, translation up to `size_m` on each. */
  Pose pose(double angle_rad, double size_m) {
    Vector6d xi;
    xi << vectorWithin(1).normalized() * uniform(0, angle_rad), Eigen::Vector3d::Zero();
    Pose T = se3Exp(xi);
    T.translation() = vectorWithin(size_m);
    return T;
  }

 private:
  std::mt19937 x_engine;
};

/** A sanitizer looks for errors that a few seeds show, and takes ten times as long for each. */
#if defined(__SANITIZE_ADDRESS__)
constexpr int kOneSeedIn = 5;
#else
constexpr int kOneSeedIn = 1;
#endif

/** \return how many seeds there were: `seeds`, or under a sanitizer a fifth of them */
template <class Law>
int forAll(int seeds, Law law) {
  const int tried = (seeds + kOneSeedIn - 1) / kOneSeedIn;
  for (int seed = 1; seed <= tried; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random rnd(static_cast<unsigned>(seed));
    law(rnd);
    if (::testing::Test::HasFatalFailure() || ::testing::Test::HasNonfatalFailure()) break;
  }
  return tried;
}

}  // namespace raceloc::test
