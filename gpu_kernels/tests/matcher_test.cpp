#include "raceloc/gpu/matcher.h"

#include "core/factor.hpp"
#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/voxel_grid.h"
#include "tests/on_each_device.h"
#include "tests/reference.h"

namespace raceloc::gpu::test {
namespace {

class Matcher : public OnEachDevice {
 protected:
  /** A map of one cloud with the default covariances. */
  VoxelMap mapOf(const Points& p, double voxel_m) {
    VoxelMap map(context(), voxel_m);
    map.insert(p.view(), covariances(context(), p.view(), {}).view(), {});
    return map;
  }
  Match matched(const Points& source, const VoxelMap& map, const Transform& guess,
                const MatchOptions& o = {}) {
    return match(context(), source.view(), covariances(context(), source.view(), {}).view(), map, guess, o);
  }
};
INSTANTIATE_TEST_SUITE_P(Devices, Matcher, ::testing::Values(Backend::cpu, Backend::cuda), deviceName);

/** Points that are nearer than 1e-4 m to the face of a voxel: float may look into the other one. */
Points clearOfFaces(const Points& p, const Transform& T, double voxel_m) {
  Points out;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const Vector q = applied(T, at(p, i));
    bool clear = true;
    for (const double x : q) clear = clear && std::fabs(x - voxel_m * std::round(x / voxel_m)) > 1e-4;
    if (clear) push(out, at(p, i)[0], at(p, i)[1], at(p, i)[2]);
  }
  return out;
}

double largest(const std::array<double, 36>& H) {
  double m = 0;
  for (const double h : H) m = std::max(m, std::fabs(h));
  return m;
}

TEST_P(Matcher, LinearizesAsTheDefinition) {
  const double voxel_m = 0.7;
  VoxelMap map(context(), voxel_m);
  const Points target = randomCloud(1, 4000, 5);
  map.insert(target.view(), randomCovariances(1, target.size()).view(), {});
  const GaussianMap reference = gaussians(map.contents());
  const Transform T = pose({0.2, -0.1, 0.4}, {0.3, -0.5, 0.2});
  const Points source = clearOfFaces(randomCloud(2, 1500, 5), T, voxel_m);
  const Covariances C = randomCovariances(2, source.size());
  for (const int around : {1, 7, 27}) {
    for (const double width : {0.0, 0.5}) {
      MatchOptions o;
      o.neighbour_voxels = around;
      o.robust_width = width;
      o.max_distance_m = 0.9;
      const auto pairs = pairsOf(source, reference, voxel_m, T, o);
      const Linearization expected = linearizeOver(pairs, source, C, T, o);
      const Linearization actual = linearize(context(), source.view(), C.view(), map, T, o);
      ASSERT_GT(expected.pairs, 800);
      EXPECT_EQ(actual.pairs, expected.pairs);
      EXPECT_EQ(actual.inliers, expected.inliers);
      // Floats a point, each inverse of a covariance of condition 100: a few 1e-6; means rounded at 5 m:
      // 1e-6.
      EXPECT_NEAR(actual.cost, expected.cost, 2e-5 * expected.cost);
      EXPECT_NEAR(actual.squared_distance_m2, expected.squared_distance_m2,
                  1e-4 * expected.squared_distance_m2);
      for (std::size_t k = 0; k < 36; ++k)
        EXPECT_NEAR(actual.H[k], expected.H[k], 2e-5 * largest(expected.H)) << k;
      for (std::size_t k = 0; k < 6; ++k)
        EXPECT_NEAR(actual.b[k], expected.b[k], 2e-5 * largest(expected.H)) << k;
    }
  }
}

TEST_P(Matcher,
       GradientIsTheSlopeOfTheCost) {  // isotropic covariances do not turn: b is then the whole derivative
  const double voxel_m = 1.0;
  const auto balls = [](std::size_t n, float variance) {
    Covariances C = randomCovariances(1, n);
    for (auto* v : {&C.xy, &C.xz, &C.yz}) std::fill(v->begin(), v->end(), 0.0F);
    for (auto* v : {&C.xx, &C.yy, &C.zz}) std::fill(v->begin(), v->end(), variance);
    return C;
  };
  VoxelMap map(context(), voxel_m);
  const Points target = randomCloud(5, 3000, 4);
  map.insert(target.view(), balls(target.size(), 0.2F).view(), {});
  const GaussianMap reference = gaussians(map.contents());
  const Transform T = pose({0, 0.3, 0.1}, {0.1, 0.2, -0.3});
  const Points source = clearOfFaces(randomCloud(6, 500, 4), T, voxel_m);
  const Covariances C = balls(source.size(), 0.1F);
  MatchOptions o;
  o.robust_width = 0.8;
  const Linearization actual = linearize(context(), source.view(), C.view(), map, T, o);
  const auto pairs = pairsOf(source, reference, voxel_m, T, o);
  for (std::size_t k = 0; k < 6; ++k) {
    Step forth{}, back{};
    forth[k] = 1e-5, back[k] = -1e-5;
    const double slope = (linearizeOver(pairs, source, C, moved(T, forth), o).cost -
                          linearizeOver(pairs, source, C, moved(T, back), o).cost) /
                         2e-5;
    EXPECT_NEAR(actual.b[k], slope, 1e-5 * largest(actual.H)) << k;
  }
}

TEST(Factor, JacobianIsTheSlopeOfTheResidual) {
  const Transform T = pose({0.3, -0.8, 0.5}, {4, 5, 6});
  const Vector p{1.5, -2.5, 0.7}, mean{5, 3, 8};
  const Sym3<double> C_source{0.3, 0.1, 0, 0.4, -0.1, 0.2}, C_map{0.5, 0, 0.2, 0.3, 0.1, 0.6};
  const auto residual_map = [&](const Transform& A) {
    const Vector q = applied(A, p);
    return Vector{mean[0] - q[0], mean[1] - q[1], mean[2] - q[2]};
  };
  const auto toSource = [&](const Vector& v) {
    const Vector u = product(flipped(rotationOf(T)), v);
    return Vec3<double>{u[0], u[1], u[2]};
  };
  const auto& R = T.R;
  const auto w =
      whitened(Mat3<double>{R[0], R[3], R[6], R[1], R[4], R[7], R[2], R[5], R[8]}, {p[0], p[1], p[2]},
               C_source, {mean[0] - T.t[0], mean[1] - T.t[1], mean[2] - T.t[2]}, C_map);
  const Vec3<double> e = toSource(residual_map(T));
  EXPECT_NEAR(w.e.x, e.x, 1e-12);
  EXPECT_NEAR(w.e.y, e.y, 1e-12);
  EXPECT_NEAR(w.e.z, e.z, 1e-12);
  std::array<Vec3<double>, 6> J{};
  for (std::size_t k = 0; k < 6; ++k) {
    Step forth{}, back{};
    forth[k] = 1e-6, back[k] = -1e-6;
    J[k] = 5e5 * (toSource(residual_map(moved(T, forth))) - toSource(residual_map(moved(T, back))));
  }
  Pass pass;
  addPair(w, {p[0], p[1], p[2]}, Robust{0.0F}, pass.sums.data());
  const Linearization at_T = linearization(pass);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_NEAR(at_T.b[i], dot(J[i], w.W * w.e), 1e-7);  // central differences of 1e-6
    for (std::size_t j = 0; j < 6; ++j) EXPECT_NEAR(at_T.H[6 * i + j], dot(J[i], w.W * J[j]), 1e-7);
  }
  EXPECT_NEAR(at_T.cost, 0.5 * w.squared, 1e-12);
}

TEST(SolveStep, SolvesAndRefuses) {
  Linearization at;
  for (std::size_t i = 0; i < 6; ++i) {
    at.b[i] = 1.0 + static_cast<double>(i);
    for (std::size_t j = 0; j < 6; ++j)
      at.H[6 * i + j] = (i == j ? 10.0 : 0.0) + std::cos(static_cast<double>(i + j));
    at.H[7 * i] *= 1e4;  // badly scaled
  }
  const auto xi = solveStep(at, 0);
  ASSERT_TRUE(xi);
  for (std::size_t i = 0; i < 6; ++i) {
    double left = at.b[i];
    for (std::size_t j = 0; j < 6; ++j) left += at.H[6 * i + j] * (*xi)[j];
    EXPECT_NEAR(left, 0, 1e-9);
  }
  for (std::size_t j = 0; j < 6; ++j) at.H[30 + j] = at.H[6 * j + 5] = at.H[24 + j];
  at.H[35] = at.H[28];  // rows 4 and 5 alike
  EXPECT_FALSE(solveStep(at, 0));
  EXPECT_FALSE(solveStep(Linearization{}, 0));
}

TEST_P(Matcher, FindsThePerturbationOfAHall) {
  const VoxelMap map = mapOf(hall(1, 20000), 1.0);
  const Points other = hall(2, 8000);  // another sample of the same hall
  for (const int around : {1, 7}) {
    MatchOptions o;
    o.neighbour_voxels = around;
    const Transform truth = pose({0.02, -0.01, 0.5}, {1.3, -0.7, 0.2});
    const Points source = applied(inverse(truth), other);
    const Transform guess = truth * pose({0.02, 0.03, 0.06}, {0.3, -0.25, 0.15});
    const Match m = matched(source, map, guess, o);
    EXPECT_EQ(m.stop, Stop::converged);
    EXPECT_LT(distance_m(m.T_map_source, truth), 0.02);  // 5 mm of noise, voxels of 1 m with few points each
    EXPECT_LT(angle_rad(m.T_map_source, truth), 0.1 * kDegree);
    EXPECT_GT(m.last.inliers, 6000);
    EXPECT_LE(m.iterations, 30);
  }
}

TEST_P(Matcher, StaysWhereItIsRight) {
  const Points cloud = hall(3, 15000);
  const Match m = matched(cloud, mapOf(cloud, 1.0), {});
  EXPECT_EQ(m.stop, Stop::converged);
  EXPECT_LT(distance_m(m.T_map_source, {}), 0.005);  // its own noise
  EXPECT_LT(angle_rad(m.T_map_source, {}), 0.05 * kDegree);
}

TEST_P(Matcher, MovesWithBothClouds) {
  const Points target = hall(4, 15000), source = hall(5, 6000);
  const Transform guess = pose({0, 0.01, 0.03}, {0.2, 0.1, -0.1});
  const Match here = matched(source, mapOf(target, 1.0), guess);
  const Transform A = pose({0.1, 0.05, 1.0}, {20, -30, 2}), B = pose({-0.2, 0.1, 0.7}, {3, 1, -1});
  const Match there = matched(applied(inverse(B), source), mapOf(applied(A, target), 1.0), A * guess * B);
  EXPECT_EQ(here.stop, Stop::converged);
  EXPECT_EQ(there.stop, Stop::converged);
  EXPECT_LT(distance_m(there.T_map_source, A * here.T_map_source * B), 0.02);  // other voxels, same hall
  EXPECT_LT(angle_rad(there.T_map_source, A * here.T_map_source * B), 0.1 * kDegree);
}

TEST_P(Matcher, InvertsWhenTheCloudsAreSwapped) {
  const Points a = hall(4, 12000), b = applied(pose({0, 0, 0.05}, {0.2, 0.1, 0.05}), hall(5, 12000));
  const Match forth = matched(a, mapOf(b, 1.0), {}), back = matched(b, mapOf(a, 1.0), {});
  EXPECT_EQ(forth.stop, Stop::converged);
  EXPECT_EQ(back.stop, Stop::converged);
  EXPECT_LT(distance_m(forth.T_map_source, inverse(back.T_map_source)), 0.02);  // other voxels, same hall
  EXPECT_LT(angle_rad(forth.T_map_source, inverse(back.T_map_source)), 0.1 * kDegree);
}

/** All lengths doubled, which is exact in binary: covariances are 4 times as large, and the answer twice as far. */
TEST_P(Matcher, ScalesWithBothClouds) {
  Points target = hall(4, 15000), source = hall(5, 6000);
  Match match[2];
  for (const double scale : {1.0, 2.0}) {
    CovarianceOptions c;
    c.regularisation = Regularisation::min_eig;  // plane's variances have no scale
    MatchOptions o;
    o.max_distance_m *= scale;
    o.translation_epsilon_m *= scale;
    for (float* length_m : {&c.radius_m, &c.laplacian_sigma_m}) *length_m *= static_cast<float>(scale);
    VoxelMap map(context(), scale);
    map.insert(target.view(), covariances(context(), target.view(), c).view(), {});
    const Transform guess = pose({0, 0.01, 0.03}, {0.2 * scale, 0.1 * scale, -0.1 * scale});
    match[scale == 2 ? 1 : 0] = raceloc::gpu::match(
        context(), source.view(), covariances(context(), source.view(), c).view(), map, guess, o);
    for (Points* p : {&target, &source})
      for (auto* axis : {&p->x, &p->y, &p->z})
        for (float& v : *axis) v *= 2;
  }
  EXPECT_EQ(match[0].stop, Stop::converged);
  EXPECT_EQ(match[1].stop, Stop::converged);
  EXPECT_EQ(match[0].iterations, match[1].iterations);
  Transform twice = match[0].T_map_source;
  for (double& t : twice.t) t *= 2;
  EXPECT_LT(distance_m(match[1].T_map_source, twice), 1e-5);  // sums of floats in units of their own
  EXPECT_LT(angle_rad(match[1].T_map_source, twice), 1e-5);
}

TEST_P(Matcher, IsAsExactFarFromTheOrigin) {  // a whole number of voxels away: the same problem
  const Points target = hall(4, 15000), source = hall(5, 6000);
  const Covariances C = covariances(context(), target.view(), {});
  VoxelMap near(context(), 1.0), far(context(), 1.0);
  const Transform away = pose({0, 0, 0}, {40000, -70000, 300});
  near.insert(target.view(), C.view(), {});
  far.insert(target.view(), C.view(), away);
  const Transform guess = pose({0, 0.01, 0.03}, {0.2, 0.1, -0.1});
  const Match here = matched(source, near, guess), there = matched(source, far, away * guess);
  EXPECT_EQ(there.stop, Stop::converged);
  EXPECT_LT(distance_m(there.T_map_source, away * here.T_map_source),
            1e-5);  // float in the voxel, double outside
}

TEST_P(Matcher, GivesTheSameBitsTwice) {
  const Points target = hall(4, 15000), source = hall(5, 6000);
  const VoxelMap map = mapOf(target, 1.0);
  const Transform guess = pose({0, 0.01, 0.03}, {0.2, 0.1, -0.1});
  const Match once = matched(source, map, guess), twice = matched(source, map, guess);
  EXPECT_EQ(once.T_map_source.R, twice.T_map_source.R);
  EXPECT_EQ(once.T_map_source.t, twice.T_map_source.t);
  EXPECT_EQ(once.last.H, twice.last.H);
}

TEST_P(Matcher, MatchesManyGuessesAsEachAlone) {
  const Points target = hall(4, 15000), source = hall(5, 3000);
  const VoxelMap map = mapOf(target, 1.0);
  const Covariances C = covariances(context(), source.view(), {});
  const std::vector<Transform> guesses{
      pose({0, 0.01, 0.03}, {0.2, 0.1, -0.1}), pose({0, 0, 1}, {500, 0, 0}), {}};
  const auto all = matchAll(context(), source.view(), C.view(), map, guesses, {});
  ASSERT_EQ(all.size(), guesses.size());
  for (std::size_t i = 0; i < guesses.size(); ++i) {
    const Match one = match(context(), source.view(), C.view(), map, guesses[i], {});
    EXPECT_EQ(all[i].stop, one.stop);
    EXPECT_EQ(all[i].T_map_source.R, one.T_map_source.R);
    EXPECT_EQ(all[i].T_map_source.t, one.T_map_source.t);
    EXPECT_EQ(all[i].last.H, one.last.H);
  }
  EXPECT_EQ(all[1].stop, Stop::too_few_inliers);
  EXPECT_TRUE(matchAll(context(), source.view(), C.view(), map, {}, {}).empty());
}

TEST_P(Matcher, AgreesWithTheRealScanPair) {
  const auto pair = readScanPair(GK_SHARED_DATA);
  if (!pair) GTEST_SKIP() << "no scan pair in " << GK_SHARED_DATA;
  const Points target = voxelGrid(context(), pair->target.view(), 0.25F);
  const Points source = voxelGrid(context(), pair->source.view(), 0.25F);
  const Match m = matched(source, mapOf(target, 1.0), {});
  EXPECT_EQ(m.stop, Stop::converged);
  EXPECT_LT(distance_m(m.T_map_source, pair->T_target_source), 0.06);  // 0.03 m of the truth, as much of ours
  EXPECT_LT(angle_rad(m.T_map_source, pair->T_target_source), 1.0 * kDegree);
  EXPECT_GT(m.last.inliers, static_cast<std::int64_t>(source.size() / 2));
}

TEST_P(Matcher, SaysWhenNothingCorresponds) {
  const VoxelMap map = mapOf(hall(1, 5000), 1.0);
  const Points source = hall(2, 2000);
  const Transform far = pose({0, 0, 1}, {500, 0, 0});
  const Match m = matched(source, map, far);
  EXPECT_EQ(m.stop, Stop::too_few_inliers);
  EXPECT_EQ(m.T_map_source.t, far.t);
  EXPECT_EQ(m.last.pairs, 0);
  EXPECT_EQ(m.last.cost, 0);
  const Match beyond = matched(source, map, pose({0, 0, 0}, {0, 5e6, 0}));  // no voxel has such an index
  EXPECT_EQ(beyond.stop, Stop::too_few_inliers);
  const Match in_nothing = matched(source, VoxelMap(context(), 1.0), {});
  EXPECT_EQ(in_nothing.stop, Stop::too_few_inliers);
}

TEST_P(Matcher, SaysWhenThereIsTooLittle) {
  const VoxelMap map = mapOf(hall(1, 5000), 1.0);
  for (const int n : {0, 1, 9}) {
    const Points source = hall(2, n);
    EXPECT_EQ(matched(source, map, {}).stop, Stop::too_few_inliers) << n;
  }
  Points same;  // many points, but one place: rotation about it is free
  for (int i = 0; i < 100; ++i) push(same, 4, 2, 1);
  EXPECT_EQ(matched(same, map, {}).stop, Stop::singular);
  const Match one_voxel = matched(same, mapOf(same, 1.0), {});
  EXPECT_EQ(one_voxel.stop, Stop::singular);
}

TEST_P(Matcher, SaysWhenItRanOut) {
  const VoxelMap map = mapOf(hall(1, 10000), 1.0);
  MatchOptions o;
  o.max_iterations = 1;
  const Match m = matched(hall(2, 5000), map, pose({0, 0, 0.06}, {0.3, 0.3, 0}), o);
  EXPECT_EQ(m.stop, Stop::max_iterations);
  EXPECT_EQ(m.iterations, 1);
}

TEST_P(Matcher, SaysWhenTheGuessIsNotFinite) {
  const VoxelMap map = mapOf(hall(1, 5000), 1.0);
  Transform guess;
  guess.t[1] = std::nan("");
  EXPECT_EQ(matched(hall(2, 500), map, guess).stop, Stop::not_finite);
}

TEST_P(Matcher, LeavesOutPointsThatAreNotFinite) {
  const VoxelMap map = mapOf(hall(1, 5000), 1.0);
  const Points good = hall(2, 500);
  Points bad = good;
  Covariances C = covariances(context(), good.view(), {});
  const Linearization before = linearize(context(), good.view(), C.view(), map, {}, {});
  push(bad, std::nan(""), 0, 0);
  push(bad, 0, HUGE_VAL, 0);
  push(bad, 3, 2, 1);  // a good place with a bad covariance
  for (int i = 0; i < 3; ++i)
    for (auto* v : {&C.xx, &C.xy, &C.xz, &C.yy, &C.yz, &C.zz}) v->push_back(i < 2 ? 0.1F : std::nanf(""));
  const Linearization after = linearize(context(), bad.view(), C.view(), map, {}, {});
  EXPECT_EQ(after.pairs, before.pairs);
  EXPECT_EQ(after.H, before.H);
}

TEST_P(Matcher, RefusesBadInput) {
  const VoxelMap map = mapOf(hall(1, 500), 1.0);
  const Points p = hall(2, 100);
  const Covariances C = randomCovariances(1, p.size()), fewer = randomCovariances(1, p.size() - 1);
  EXPECT_THROW((void)linearize(context(), p.view(), fewer.view(), map, {}, {}), std::invalid_argument);
  EXPECT_THROW((void)match(context(), p.view(), fewer.view(), map, {}, {}), std::invalid_argument);
  const auto refuses = [&](auto change) {
    MatchOptions o;
    change(o);
    EXPECT_THROW((void)match(context(), p.view(), C.view(), map, {}, o), std::invalid_argument);
  };
  refuses([](auto& o) { o.max_iterations = 0; });
  refuses([](auto& o) { o.translation_epsilon_m = 0; });
  refuses([](auto& o) { o.rotation_epsilon_rad = -1; });
  refuses([](auto& o) { o.neighbour_voxels = 8; });
  refuses([](auto& o) { o.robust_width = -1; });
  refuses([](auto& o) { o.max_distance_m = std::nan(""); });
}

}  // namespace
}  // namespace raceloc::gpu::test
