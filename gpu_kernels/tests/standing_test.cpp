#include "raceloc/gpu/standing.h"

#include <algorithm>
#include <limits>
#include <map>

#include "tests/on_each_device.h"
#include "tests/reference.h"
#include "tests/scenes.h"

namespace raceloc::gpu::test {
namespace {

class Standing : public OnEachDevice {};
INSTANTIATE_TEST_SUITE_P(Devices, Standing, ::testing::Values(Backend::cpu, Backend::cuda), deviceName);

void expectSame(const StandingCells& a, const StandingCells& b) {
  EXPECT_EQ(a.face.x, b.face.x);
  EXPECT_EQ(a.face.y, b.face.y);
  EXPECT_EQ(a.face.z, b.face.z);
  EXPECT_EQ(a.upper.x, b.upper.x);
  EXPECT_EQ(a.upper.y, b.upper.y);
  EXPECT_EQ(a.upper.z, b.upper.z);
  EXPECT_EQ(a.lowest_m, b.lowest_m);
  EXPECT_EQ(a.highest_m, b.highest_m);
  EXPECT_EQ(a.standing, b.standing);
}

TEST_P(Standing, IsWhatAMapOfCellsSays) {
  const StandingOptions o;
  Points p = randomCloud(3, 20000, 20);
  for (float& z : p.z) z *= 0.1F;  // heights of +-2 m
  std::map<std::pair<int, int>, std::vector<std::size_t>> cells;
  for (std::size_t i = 0; i < p.size(); ++i)
    cells[{static_cast<int>(std::floor(p.y[i] / o.cell_m)), static_cast<int>(std::floor(p.x[i] / o.cell_m))}]
        .push_back(i);
  StandingCells expected;
  std::vector<std::uint8_t> expected_standing(p.size(), 0), is_standing;
  for (const auto& [index, inside] : cells) {
    const auto height = [&](std::size_t i) { return p.z[i]; };
    const float lowest_m = height(*std::min_element(inside.begin(), inside.end(),
                                                    [&](auto i, auto j) { return height(i) < height(j); }));
    float highest_m = lowest_m;
    int within = 0;
    std::vector<std::size_t> standing;
    std::array<double, 3> sum{};
    for (const std::size_t i : inside) {
      if (!(p.z[i] - lowest_m <= o.reach_m)) continue;
      ++within;
      highest_m = std::max(highest_m, p.z[i]);
      if (!(p.z[i] - lowest_m > o.foot_m)) continue;
      standing.push_back(i);
      for (std::size_t k = 0; k < 3; ++k) sum[k] += at(p, i)[k];
    }
    if (within < o.min_points || highest_m - lowest_m < o.min_spread_m) continue;
    const auto n = static_cast<double>(standing.size());
    push(expected.face, sum[0] / n, sum[1] / n, sum[2] / n);
    std::array<double, 3> high{};
    double count = 0;
    for (const std::size_t i : standing) {
      if (!(p.z[i] - lowest_m >= 0.5F * (highest_m - lowest_m))) continue;
      for (std::size_t k = 0; k < 3; ++k) high[k] += at(p, i)[k];
      ++count;
    }
    push(expected.upper, high[0] / count, high[1] / count, high[2] / count);
    expected.lowest_m.push_back(lowest_m);
    expected.highest_m.push_back(highest_m);
    expected.standing.push_back(static_cast<std::int32_t>(standing.size()));
    for (const std::size_t i : standing) expected_standing[i] = 1;
  }
  EXPECT_GT(expected.size(), 1000U);
  const StandingCells found = standingCells(context(), p.view(), o, &is_standing);
  expectSame(found, expected);  // sums of floats in double are exact
  EXPECT_EQ(is_standing, expected_standing);
}

/** A wall of `beams` returns above each other every half metre, 10 m to the left. */
Points wall(int beams, double apart_m) {
  Points p;
  for (int i = 0; i < 40; ++i)
    for (int b = 0; b < beams; ++b) push(p, 0.5 * i + 0.2, 10.2, -0.3 + apart_m * b);
  return p;
}

TEST_P(Standing, TakesAStackOfThreeHoweverFar) {  // 128 beams over 45 deg are 0.37 m apart at 60 m
  EXPECT_EQ(standingCells(context(), wall(3, 0.37).view(), {}).size(), 40U);
  EXPECT_EQ(standingCells(context(), wall(2, 0.5).view(), {}).size(), 0U) << "two are not enough";
  EXPECT_EQ(standingCells(context(), wall(9, 0.04).view(), {}).size(), 0U) << "a kerb, however dense";
}

TEST_P(Standing, LeavesSlopesAndKerbsAlone) {
  Points p;
  const double rise = std::tan(24 * M_PI / 180);
  for (int i = -280; i < 280; ++i)
    for (int j = -280; j < 280; ++j) {
      const double x = 0.07 * i, y = 0.07 * j;
      const double along = 0.8 * x + 0.6 * y;  // across the cells
      push(p, x, y, rise * along + 0.01 * std::sin(40 * x * y));
    }
  EXPECT_EQ(standingCells(context(), p.view(), {}).size(), 0U);
}

TEST_P(Standing, LooksPastABridge) {
  Points p = wall(4, 0.3);
  const StandingCells alone = standingCells(context(), p.view(), {});
  for (std::size_t i = 0; i < 40; ++i)
    push(p, 0.5 * static_cast<double>(i) + 0.2, 10.3, 5);  // its underside is no part of the wall
  expectSame(standingCells(context(), p.view(), {}), alone);
}

TEST_P(Standing, GivesTheBitsOfTheCpuWithAnyNumberOfThreads) {
  Points p = unevenVoxels(2);
  push(p, std::nan(""), 0, 0);
  push(p, 0, 0, HUGE_VAL);
  push(p, 1e9, 0, 0);
  std::vector<std::uint8_t> here, there;
  Context cpu(Backend::cpu, 0, 3);
  const StandingCells expected = standingCells(cpu, p.view(), {}, &there);
  EXPECT_GT(expected.size(), 10U);
  expectSame(standingCells(context(), p.view(), {}, &here), expected);
  EXPECT_EQ(here, there);
}

TEST_P(Standing, TakesTheSmallestClouds) {
  std::vector<std::uint8_t> is_standing{1};
  EXPECT_EQ(standingCells(context(), Points{}.view(), {}, &is_standing).size(), 0U);
  EXPECT_TRUE(is_standing.empty());
  Points nothing;
  for (int i = 0; i < 5; ++i) push(nothing, std::nan(""), 0, i);
  EXPECT_EQ(standingCells(context(), nothing.view(), {}, &is_standing).size(), 0U);
  EXPECT_EQ(is_standing, std::vector<std::uint8_t>(5, 0));
}

TEST_P(Standing, RefusesOptionsThatAreNone) {
  const Points p = wall(3, 0.4);
  for (const float bad : {0.0F, -1.0F, std::nanf(""), HUGE_VALF})
    for (float StandingOptions::*member :
         {&StandingOptions::cell_m, &StandingOptions::min_spread_m, &StandingOptions::foot_m,
          &StandingOptions::reach_m, &StandingOptions::max_range_m}) {
      StandingOptions o;
      o.*member = bad;
      EXPECT_THROW((void)standingCells(context(), p.view(), o), std::invalid_argument);
    }
  StandingOptions fine;
  fine.cell_m = 1e-3F;  // 80000 cells to each side
  EXPECT_THROW((void)standingCells(context(), p.view(), fine), std::invalid_argument);
}

}  // namespace
}  // namespace raceloc::gpu::test
