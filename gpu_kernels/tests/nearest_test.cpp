/** \file
 * Nearest points: covariances of the k nearest and GICP, against brute force. */
#include <gtest/gtest.h>

#include <limits>

#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/matcher.h"
#include "raceloc/gpu/nearest_target.h"
#include "raceloc/gpu/voxel_grid.h"
#include "tests/reference.h"

namespace raceloc::gpu::test {
namespace {

CovarianceOptions kNearest(int k) {
  CovarianceOptions o;
  o.neighbourhood = Neighbourhood::nearest;
  o.nearest = k;
  o.regularisation = Regularisation::none;
  o.min_neighbours = 4;
  return o;
}

/** Clouds that are hard on a tree. */
std::vector<std::pair<std::string, Points>> clouds() {
  std::vector<std::pair<std::string, Points>> all;
  for (const int n : {1, 4, 15, 16, 17, 33, 1000}) all.emplace_back(std::to_string(n), randomCloud(1, n, 5));
  all.emplace_back("hall", hall(1, 3000));
  Points line, same, lattice;
  for (int i = 0; i < 500; ++i) push(line, 0.1 * i, 0, 0);
  for (int i = 0; i < 300; ++i) push(same, 1, 2, 3);
  for (int z = 0; z < 10; ++z)  // ties everywhere
    for (int y = 0; y < 10; ++y)
      for (int x = 0; x < 10; ++x) push(lattice, x, y, z);
  all.emplace_back("line", line);
  all.emplace_back("same", same);
  all.emplace_back("lattice", lattice);
  Points far = randomCloud(2, 500, 5);
  for (float& x : far.x) x += 5000;
  all.emplace_back("far", far);
  return all;
}

/** Squared distance as a float computes it: what orders neighbours. */
float squared(const Points& p, std::size_t i, const Vector& q) {
  const float x = p.x[i] - static_cast<float>(q[0]), y = p.y[i] - static_cast<float>(q[1]),
              z = p.z[i] - static_cast<float>(q[2]);
  return x * x + y * y + z * z;
}

TEST(NearestCovariances, AreThoseOfTheKNearest) {
  Context cpu(Backend::cpu);
  for (const auto& [name, p] : clouds()) {
    SCOPED_TRACE(name);
    for (const int k : {4, 10, 64}) {
      const Covariances C = covariances(cpu, p.view(), kNearest(k));
      for (std::size_t i = 0; i < p.size(); i += 11) {
        std::vector<std::pair<float, std::size_t>> all;
        for (std::size_t j = 0; j < p.size(); ++j) all.emplace_back(squared(p, j, at(p, i)), j);
        std::sort(all.begin(), all.end());
        all.resize(std::min(all.size(), static_cast<std::size_t>(k)));
        ASSERT_EQ(static_cast<std::size_t>(C.neighbours[i]), all.size());
        if (all.size() < 4) continue;
        Vector mean{};
        for (const auto& [d, j] : all)
          for (std::size_t a = 0; a < 3; ++a) mean[a] += at(p, j)[a] / static_cast<double>(all.size());
        Matrix expected{};
        for (const auto& [d, j] : all)
          for (std::size_t r = 0; r < 3; ++r)
            for (std::size_t c = 0; c < 3; ++c)
              expected[r][c] +=
                  (at(p, j)[r] - mean[r]) * (at(p, j)[c] - mean[c]) / static_cast<double>(all.size());
        const Matrix actual = matrixAt(C, i);
        const double size = 1 + static_cast<double>(all.back().first);
        for (std::size_t r = 0; r < 3; ++r)
          for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(actual[r][c], expected[r][c], 1e-6 * size) << i;
      }
    }
  }
}

/** Pairs of a pass by brute force. */
std::vector<std::pair<std::size_t, const Gaussian*>> nearestPairs(const Points& source, const Points& target,
                                                                  const std::vector<Gaussian>& gaussians,
                                                                  const Transform& T, double gate_m) {
  std::vector<std::pair<std::size_t, const Gaussian*>> pairs;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Vector q = applied(T, at(source, i));
    double best = gate_m * gate_m;
    const Gaussian* nearest = nullptr;
    for (std::size_t j = 0; j < target.size(); ++j) {
      const Vector d{at(target, j)[0] - q[0], at(target, j)[1] - q[1], at(target, j)[2] - q[2]};
      if (scalar(d, d) > best) continue;
      best = scalar(d, d);
      nearest = &gaussians[j];
    }
    if (nearest != nullptr) pairs.emplace_back(i, nearest);
  }
  return pairs;
}

TEST(Gicp, LinearizesAsTheDefinition) {
  const Points target = randomCloud(1, 1500, 4), source = randomCloud(2, 900, 4);
  const Covariances C_target = randomCovariances(1, target.size()), C = randomCovariances(2, source.size());
  std::vector<Gaussian> gaussians;
  for (std::size_t j = 0; j < target.size(); ++j) gaussians.push_back({at(target, j), matrixAt(C_target, j)});
  const Transform T = pose({0.2, -0.1, 0.4}, {0.3, -0.5, 0.2});
  MatchOptions o;
  o.max_distance_m = 0.4;
  o.robust_width = 0.5;
  const Linearization expected =
      linearizeOver(nearestPairs(source, target, gaussians, T, o.max_distance_m), source, C, T, o);
  for (const int threads : {1, 2}) {
    Context cpu(Backend::cpu, 0, threads);
    const Linearization actual =
        linearize(cpu, source.view(), C.view(), NearestTarget(target.view(), C_target.view()), T, o);
    ASSERT_GT(expected.pairs, 300);
    ASSERT_LT(expected.pairs, 900);  // the gate does something
    EXPECT_EQ(actual.pairs, expected.pairs);
    EXPECT_EQ(actual.inliers, expected.inliers);
    EXPECT_NEAR(actual.cost, expected.cost, 2e-5 * expected.cost);  // as VGICP's
    double largest = 0;
    for (const double h : expected.H) largest = std::max(largest, std::fabs(h));
    for (std::size_t k = 0; k < 36; ++k) EXPECT_NEAR(actual.H[k], expected.H[k], 2e-5 * largest) << k;
    for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(actual.b[k], expected.b[k], 2e-5 * largest) << k;
  }
}

Match aligned(const Points& source, const Points& target, const Transform& guess, const MatchOptions& o = {},
              int threads = 1) {
  Context cpu(Backend::cpu, 0, threads);
  const NearestTarget tree(target.view(), covariances(cpu, target.view(), {}).view());
  return match(cpu, source.view(), covariances(cpu, source.view(), {}).view(), tree, guess, o);
}

TEST(Gicp, FindsThePerturbationOfAHall) {
  const Transform truth = pose({0.02, -0.01, 0.5}, {1.3, -0.7, 0.2});
  const Points target = hall(1, 20000), source = applied(inverse(truth), hall(2, 8000));
  const Match m = aligned(source, target, truth * pose({0.02, 0.03, 0.06}, {0.3, -0.25, 0.15}));
  EXPECT_EQ(m.stop, Stop::converged);
  EXPECT_LT(distance_m(m.T_map_source, truth), 0.01);  // 5 mm of noise a point
  EXPECT_LT(angle_rad(m.T_map_source, truth), 0.05 * kDegree);
}

TEST(Gicp, InvertsWhenTheCloudsAreSwapped) {
  const Points a = hall(4, 12000), b = applied(pose({0, 0, 0.05}, {0.2, 0.1, 0.05}), hall(5, 12000));
  MatchOptions o;
  o.translation_epsilon_m = 1e-5;
  o.rotation_epsilon_rad = 1e-5;
  const Match forth = aligned(a, b, {}, o), back = aligned(b, a, {}, o);
  EXPECT_EQ(forth.stop, Stop::converged);
  EXPECT_EQ(back.stop, Stop::converged);
  EXPECT_LT(distance_m(forth.T_map_source, inverse(back.T_map_source)), 0.005);  // other pairs, same hall
  EXPECT_LT(angle_rad(forth.T_map_source, inverse(back.T_map_source)), 0.05 * kDegree);
}

TEST(Gicp, AgreesWithTheRealScanPair) {
  const auto pair = readScanPair(GK_SHARED_DATA);
  if (!pair) GTEST_SKIP() << "no scan pair in " << GK_SHARED_DATA;
  Context cpu(Backend::cpu);
  const Points target = voxelGrid(cpu, pair->target.view(), 0.25F);
  const Points source = voxelGrid(cpu, pair->source.view(), 0.25F);
  const Match m = aligned(source, target, {});
  EXPECT_EQ(m.stop, Stop::converged);
  EXPECT_LT(distance_m(m.T_map_source, pair->T_target_source), 0.06);  // 0.03 m of the truth, as much of ours
  EXPECT_LT(angle_rad(m.T_map_source, pair->T_target_source), 1.0 * kDegree);
  const Match threaded = aligned(source, target, {}, {}, 2);
  EXPECT_EQ(m.T_map_source.R, threaded.T_map_source.R);
  EXPECT_EQ(m.T_map_source.t, threaded.T_map_source.t);
}

TEST(Gicp, SaysWhatItCannotDo) {
  const Points target = hall(1, 3000), source = hall(2, 2000);
  EXPECT_EQ(aligned(source, target, pose({0, 0, 1}, {500, 0, 0})).stop, Stop::too_few_inliers);
  EXPECT_EQ(aligned(source, Points{}, {}).stop, Stop::too_few_inliers);
  EXPECT_EQ(aligned(hall(2, 9), target, {}).stop, Stop::too_few_inliers);
  Transform nowhere;
  nowhere.t[0] = std::nan("");
  EXPECT_EQ(aligned(source, target, nowhere).stop, Stop::not_finite);
  Points bad = target;
  push(bad, std::nan(""), 0, 0);
  push(bad, 0, HUGE_VAL, 0);
  const NearestTarget tree(bad.view(), randomCovariances(1, bad.size()).view());
  EXPECT_EQ(tree.dropped(), 2U);
  EXPECT_EQ(tree.size(), target.size());
  EXPECT_THROW(NearestTarget(target.view(), randomCovariances(1, 5).view()), std::invalid_argument);
  Context cpu(Backend::cpu);
  EXPECT_THROW((void)covariances(cpu, target.view(), kNearest(3)), std::invalid_argument);
  EXPECT_THROW((void)covariances(cpu, target.view(), kNearest(65)), std::invalid_argument);
}

}  // namespace
}  // namespace raceloc::gpu::test
