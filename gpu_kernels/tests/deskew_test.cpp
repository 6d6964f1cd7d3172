#include "raceloc/gpu/deskew.h"

#include <cfloat>
#include <limits>

#include "api/deskew_job.hpp"
#include "tests/on_each_device.h"
#include "tests/reference.h"

namespace raceloc::gpu::test {
namespace {

class Deskew : public OnEachDevice {};
INSTANTIATE_TEST_SUITE_P(Devices, Deskew, ::testing::Values(Backend::cpu, Backend::cuda), deviceName);

constexpr Crop kEverything{0, 1e6F, 0, 0, 0};

/** A point at its own time: entries between those of the steps around it. */
Vector movedAt(const MovingScan& m, const Vector& p, double time_s) {
  const double last = static_cast<double>(m.T_end_lidar.size() - 1);
  const double step = std::clamp(time_s / static_cast<double>(m.sweep_s) * last, 0.0, last);
  const auto k = static_cast<std::size_t>(std::min(step, last - 1));
  const double share = step - static_cast<double>(k);
  const auto entry = [&](std::size_t e) {
    return (1 - share) * static_cast<double>(m.T_end_lidar[k][e]) +
           share * static_cast<double>(m.T_end_lidar[k + 1][e]);
  };
  Vector q{};
  for (std::size_t r = 0; r < 3; ++r)
    q[r] = entry(4 * r) * p[0] + entry(4 * r + 1) * p[1] + entry(4 * r + 2) * p[2] + entry(4 * r + 3);
  return q;
}

/** Metres inside the crop; negative outside. */
double inside_m(const Crop& crop, const Vector& p_lidar, const Vector& p_end) {
  const auto d = [](float x) { return static_cast<double>(x); };
  const double range_m = std::sqrt(scalar(p_lidar, p_lidar));
  const double off_the_car_m =
      std::max({-d(crop.own_car_rear_m) - p_end[0], p_end[0] - d(crop.own_car_front_m),
                std::fabs(p_end[1]) - d(crop.own_car_half_width_m)});
  return std::min({range_m - d(crop.min_range_m), d(crop.max_range_m) - range_m, off_the_car_m});
}

TEST_P(Deskew, MovesEachPointByItsOwnTimeAndCrops) {
  constexpr double rounding_m = 1e-4;  // floats of 100 m, four products
  const Crop crop{5, 60, 20, 10, 4};
  for (const unsigned seed : {1U, 2U, 3U}) {
    MovingScan m = moving(randomCloud(seed, 5003, 50));  // no multiple of a group or block
    std::mt19937 engine(seed);
    std::uniform_real_distribution<float> sometime_s(-0.01F, 0.11F);  // outside the sweep too
    for (float& t : m.time_s) t = sometime_s(engine);
    const Deskewed out = deskew(context(), m.scan.view(), m.time_s.data(), m.sweep(), crop);
    ASSERT_EQ(out.points.size(), out.indices.size());
    std::size_t k = 0;
    for (std::size_t i = 0; i < m.scan.size(); ++i) {
      const Vector p = at(m.scan, i), q = movedAt(m, p, static_cast<double>(m.time_s[i]));
      const bool kept = k < out.indices.size() && out.indices[k] == i;
      if (std::fabs(inside_m(crop, p, q)) > rounding_m) {
        ASSERT_EQ(kept, inside_m(crop, p, q) > 0) << i;
      }
      if (!kept) continue;
      for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_NEAR(at(out.points, k)[axis], q[axis], rounding_m);
      ++k;
    }
    EXPECT_EQ(k, out.indices.size());  // in the order of the scan, each once
    EXPECT_GT(k, 1000U);
  }
}

TEST(DeskewReach, HoldsEveryKeptPoint) {
  const Crop crop{0, 60, 0, 0, 0};
  Context cpu(Backend::cpu);
  for (const unsigned seed : {1U, 2U, 3U}) {
    MovingScan m = moving(randomCloud(seed, 5000, 50));
    for (std::size_t i = 0; i < 1000; ++i)  // as far along an axis as they may be
      m.scan.x[i] = i % 2 == 0 ? 60.0F : -60.0F, m.scan.y[i] = m.scan.z[i] = 0;
    for (const float* time_s : std::initializer_list<const float*>{m.time_s.data(), nullptr}) {
      const std::vector<SweepStep> steps = sweepSteps(m.sweep(), time_s != nullptr);
      const Vec3<double> reach = reach_m(deskewJob(m.scan.view(), time_s, m.sweep(), steps, crop));
      const Deskewed kept = deskew(cpu, m.scan.view(), time_s, m.sweep(), crop);
      EXPECT_GT(kept.points.size(), 1000U);
      Vector farthest_m{};
      for (std::size_t i = 0; i < kept.points.size(); ++i)
        for (std::size_t axis = 0; axis < 3; ++axis)
          farthest_m[axis] = std::max(farthest_m[axis], std::fabs(at(kept.points, i)[axis]));
      EXPECT_LE(farthest_m[0], reach.x);
      EXPECT_LE(farthest_m[1], reach.y);
      EXPECT_LE(farthest_m[2], reach.z);
      EXPECT_GT(farthest_m[0], 0.9 * reach.x);  // and is not much more than that
    }
  }
}

TEST_P(Deskew, GivesTheBitsOfTheCpu) {
  Context cpu(Backend::cpu);
  const MovingScan m = moving(hall(4, 20000));
  for (const float* time_s : std::initializer_list<const float*>{m.time_s.data(), nullptr}) {
    const Deskewed here = deskew(context(), m.scan.view(), time_s, m.sweep(), {});
    const Deskewed there = deskew(cpu, m.scan.view(), time_s, m.sweep(), {});
    const Deskewed again = deskew(context(), m.scan.view(), time_s, m.sweep(), {});
    for (const Deskewed* other : {&there, &again}) {
      EXPECT_EQ(here.indices, other->indices);
      EXPECT_EQ(here.points.x, other->points.x);
      EXPECT_EQ(here.points.y, other->points.y);
      EXPECT_EQ(here.points.z, other->points.z);
    }
  }
}

TEST_P(Deskew, TakesPointsWithoutAMotionAsOfTheEnd) {
  const MovingScan m = moving(randomCloud(5, 100, 50));
  SweepView sudden = m.sweep();
  sudden.duration_s = 0;
  const SweepView end{&m.T_end_lidar.back(), 1, 0.1F};
  const Deskewed expected = deskew(context(), m.scan.view(), m.time_s.data(), end, kEverything);
  ASSERT_EQ(expected.points.size(), m.scan.size());
  const Vector q = movedAt(m, at(m.scan, 0), 0.1);
  for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_NEAR(at(expected.points, 0)[axis], q[axis], 1e-5);
  for (const Deskewed& other : {deskew(context(), m.scan.view(), nullptr, m.sweep(), kEverything),
                                deskew(context(), m.scan.view(), m.time_s.data(), sudden, kEverything)}) {
    EXPECT_EQ(other.points.x, expected.points.x);
    EXPECT_EQ(other.points.y, expected.points.y);
    EXPECT_EQ(other.points.z, expected.points.z);
  }
}

TEST_P(Deskew, DropsWhatIsNotFinite) {
  for (const float bad : {kNan, kInf, -kInf}) {
    MovingScan m = moving(randomCloud(6, 40, 50));
    m.scan.x[3] = m.scan.y[17] = m.scan.z[38] = m.time_s[20] = bad;
    std::vector<std::uint32_t> expected;
    for (std::uint32_t i = 0; i < 40; ++i)
      if (i != 3 && i != 17 && i != 38 && i != 20) expected.push_back(i);
    for (const float sweep_s : {0.1F, 1e-7F, 0.0F}) {
      m.sweep_s = sweep_s;
      EXPECT_EQ(deskew(context(), m.scan.view(), m.time_s.data(), m.sweep(), kEverything).indices, expected);
    }
    const Crop widest{0, FLT_MAX, 0, 0, 0};
    EXPECT_EQ(deskew(context(), m.scan.view(), nullptr, m.sweep(), widest).indices.size(), 37U);
  }
}

TEST_P(Deskew, KeepsTheLimits) {
  const Affine still{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  Points p;
  for (const double x : {1.0, 2.0, 60.0, 61.0, -4.0}) push(p, x, 0, 0);
  const auto kept = [&](const Crop& crop) {
    return deskew(context(), p.view(), nullptr, {&still, 1, 0}, crop).indices;
  };
  EXPECT_EQ(kept({2, 60, 0, 0, 0}), (std::vector<std::uint32_t>{1, 2, 4}));
  EXPECT_EQ(kept({0, 100, 2, 4, 1}), (std::vector<std::uint32_t>{1, 2, 3, 4}));  // on the box is not in it
}

TEST_P(Deskew, TakesTheSmallestScans) {
  const MovingScan m = moving(randomCloud(7, 1, 50));
  EXPECT_EQ(deskew(context(), Points{}.view(), nullptr, m.sweep(), {}).points.size(), 0U);
  EXPECT_EQ(deskew(context(), m.scan.view(), m.time_s.data(), m.sweep(), kEverything).indices,
            std::vector<std::uint32_t>{0});
  const Crop nothing{0, 1e-3F, 0, 0, 0};
  EXPECT_EQ(deskew(context(), m.scan.view(), m.time_s.data(), m.sweep(), nothing).points.size(), 0U);
}

TEST_P(Deskew, RefusesWhatIsNoSweepOrCrop) {
  const MovingScan m = moving(randomCloud(8, 10, 50));
  const auto run = [&](const SweepView& sweep, const Crop& crop) {
    (void)deskew(context(), m.scan.view(), m.time_s.data(), sweep, crop);
  };
  EXPECT_THROW(run({m.T_end_lidar.data(), 0, 0.1F}, {}), std::invalid_argument);
  for (const float bad : {-1.0F, kNan, kInf}) {
    SweepView sweep = m.sweep();
    sweep.duration_s = bad;
    EXPECT_THROW(run(sweep, {}), std::invalid_argument) << bad;
    for (float Crop::*limit : {&Crop::min_range_m, &Crop::max_range_m, &Crop::own_car_front_m,
                               &Crop::own_car_rear_m, &Crop::own_car_half_width_m}) {
      Crop crop;
      crop.*limit = bad;
      EXPECT_THROW(run(m.sweep(), crop), std::invalid_argument) << bad;
    }
  }
  MovingScan broken = m;
  broken.T_end_lidar[9][6] = kInf;
  EXPECT_THROW(run(broken.sweep(), {}), std::invalid_argument);
}

}  // namespace
}  // namespace raceloc::gpu::test
