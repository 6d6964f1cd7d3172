/** \file
 * Loop closure: candidates by racetrack ID, submaps in a corridor whose posts repeat, neighbours that must agree. */
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "graph/loop_search.h"
#include "graph/map_graphs.h"
#include "support/forall.h"
#include "track/track_id.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

constexpr double kKey_m = 2;      // between key poses
constexpr double kPosts_m = 4;    // between posts
constexpr double kSigma = 22.46;  // chi-square, 6 degrees of freedom: about 4 sigma, 3.5 on each axis

/** What lies beside a straight road along x. */
struct Corridor {
  double length_m = 300;
  bool posts = true;
  std::vector<std::pair<double, double>> houses;  ///< begin and end along x, their fronts 9 m from the middle
};

/** Houses in the first `share` of a corridor, at no regular distance. */
Corridor corridorWithHouses(Random& rnd, double share) {
  Corridor corridor;
  for (double x_m = -30; x_m < share * corridor.length_m;) {
    x_m += rnd.uniform(8, 25);
    corridor.houses.emplace_back(x_m, x_m + rnd.uniform(2, 6));
  }
  return corridor;
}

/** Points within 25 m along the road of a car at T_map_body, 1 cm of noise; body frame. */
Cloud scanOf(const Corridor& corridor, const Pose& T_map_body, Random& rnd) {
  Cloud cloud;
  const Pose T_body_map = T_map_body.inverse();
  const double x_m = T_map_body.translation().x();
  const auto see = [&](double x, double y, double z) {
    if (std::abs(x - x_m) > 25) return;
    const Eigen::Vector3d noise_m(rnd.normal(0.01), rnd.normal(0.01), rnd.normal(0.01));
    cloud.push((T_body_map * (Eigen::Vector3d(x, y, z) + noise_m)).cast<float>());
  };
  for (int k = 0; k < 500; ++k) {
    see(x_m + rnd.uniform(-25, 25), rnd.uniform(-7, 7), 0);
    see(x_m + rnd.uniform(-25, 25), rnd.oneOf({-7.0, 7.0}), rnd.uniform(0, 1));
  }
  if (corridor.posts)
    for (double post_m = kPosts_m * std::floor((x_m - 25) / kPosts_m); post_m < x_m + 25; post_m += kPosts_m)
      for (int k = 0; k < 40; ++k) {
        const double angle_rad = rnd.uniform(-M_PI, M_PI);
        see(post_m + 0.2 * std::cos(angle_rad), rnd.oneOf({-6.5, 6.5}) + 0.2 * std::sin(angle_rad),
            rnd.uniform(0, 3));
      }
  for (const auto& [begin_m, end_m] : corridor.houses)
    for (int k = 0; k < 120; ++k) {
      see(rnd.oneOf({begin_m, end_m}), 5 + rnd.uniform(0, 4), rnd.uniform(0, 5));
      see(rnd.uniform(begin_m, end_m), 5, rnd.uniform(0, 5));
    }
  return cloud;
}

Pose noisy(const Pose& T, Random& rnd, double sigma_rad, double sigma_m) {
  Vector6d noise;
  for (int axis = 0; axis < 3; ++axis) noise(axis) = rnd.normal(sigma_rad);
  for (int axis = 3; axis < 6; ++axis) noise(axis) = rnd.normal(sigma_m);
  return T * se3Exp(noise);
}

/** Two drives through a corridor, the second one `drift` away from where it is believed to be. */
struct TwoDrives {
  Corridor corridor;
  std::vector<Pose> T_map_body;  ///< the truth
  std::vector<Pose> T_believed;
  std::vector<unsigned> seeds;  ///< of the scans
  OdometryChain chain;
  std::size_t keys;  ///< of each drive

  TwoDrives(Corridor where, const Eigen::Vector3d& drift_m, Random& rnd)
      : corridor(std::move(where)), keys(static_cast<std::size_t>(corridor.length_m / kKey_m)) {
    constexpr double kStep_rad = 2e-4, kStep_m = 0.01;
    for (int drive = 0; drive < 2; ++drive)
      for (std::size_t k = 0; k < keys; ++k) {
        const double x_m = kKey_m * static_cast<double>(k) + rnd.uniform(-0.5, 0.5);
        T_map_body.push_back(poseFromRpy({x_m, rnd.uniform(-1, 1), 1}, 0, 0, rnd.uniform(-0.03, 0.03)));
        T_believed.push_back(drive == 0 ? T_map_body.back()
                                        : Eigen::Translation3d(drift_m) * T_map_body.back());
        seeds.push_back(static_cast<unsigned>(rnd.integer(1, 1'000'000)));
        BodyMotion motion;
        if (k > 0) {
          motion.duration_s = 0.1;
          motion.T_start_end =
              noisy(T_map_body[T_map_body.size() - 2].inverse() * T_map_body.back(), rnd, kStep_rad, kStep_m);
          motion.covariance.diagonal() << Eigen::Vector3d::Constant(kStep_rad * kStep_rad),
              Eigen::Vector3d::Constant(kStep_m * kStep_m);
        }
        chain.add(motion);
      }
  }
  [[nodiscard]] KeyScans scans() const {
    return [this](std::size_t key) {
      Random rnd(seeds[key]);
      return scanOf(corridor, T_map_body[key], rnd);
    };
  }
  /** Key k of the first drive with key k of the second one, every `step` of them. */
  [[nodiscard]] std::vector<LoopCandidate> candidates(std::size_t step) const {
    std::vector<LoopCandidate> all;
    for (std::size_t k = step; k + step < keys; k += step) all.push_back(between(k, keys + k));
    return all;
  }
  [[nodiscard]] LoopCandidate between(std::size_t i, std::size_t j) const {
    return {i, j, T_believed[i].inverse() * T_believed[j], LoopOptions{}.search_m};
  }
  [[nodiscard]] Pose truth(std::size_t i, std::size_t j) const {
    return T_map_body[i].inverse() * T_map_body[j];
  }
};

/** Squared distance of a pose from the truth in the sigmas of its covariance. */
double sigmas2(const Pose& T, const Matrix6d& covariance, const Pose& truth) {
  const Vector6d error = se3Log(truth.inverse() * T);
  return error.dot(covariance.inverse() * error);
}

std::vector<LoopMatch> matchAll(const TwoDrives& drives, const std::vector<LoopCandidate>& candidates) {
  gpu::Context context(gpu::Backend::cpu);
  const LoopMatcher matcher(context, drives.chain, drives.scans(), {}, {}, {});
  std::vector<LoopMatch> matches;
  for (const auto& candidate : candidates) matches.push_back(matcher.match(candidate));
  return matches;
}

TEST(LoopsProperty, TrueLoopsAreFoundThroughTheDriftAndWithinTheirCovariance) {
  forAll(2, [](Random& rnd) {
    const TwoDrives drives(corridorWithHouses(rnd, 1), {rnd.uniform(-5, 5), rnd.uniform(-2, 2), 0}, rnd);
    const auto candidates = drives.candidates(25);
    const LoopClosures loops = consistentLoops(matchAll(drives, candidates), drives.chain, {});
    EXPECT_EQ(loops.edges.size() + loops.refused.size(), candidates.size());
    EXPECT_GE(loops.edges.size(), candidates.size() - 1);
    for (const auto& refused : loops.refused) ADD_FAILURE() << text(refused);
    for (const auto& edge : loops.edges) {
      EXPECT_LT(sigmas2(edge.T_i_j, edge.covariance, drives.truth(edge.i, edge.j)), kSigma);
      EXPECT_LT((drives.truth(edge.i, edge.j).inverse() * edge.T_i_j).translation().norm(), 0.15);
      EXPECT_GE(edge.agreeing, LoopOptions{}.min_agreeing);
    }
  });
}

TEST(LoopsProperty, RepeatedPostsDoNotLockOnePostOff) {
  forAll(2, [](Random& rnd) {
    // Drift of nearly one post: of the places where posts fit, the wrong one is nearer. Houses along a quarter only.
    const TwoDrives drives(corridorWithHouses(rnd, 0.25), {0.8 * kPosts_m * rnd.oneOf({-1.0, 1.0}), 0.3, 0},
                           rnd);
    const auto candidates = drives.candidates(12);
    const auto matches = matchAll(drives, candidates);
    EXPECT_GT(
        std::count_if(matches.begin(), matches.end(), [](const auto& m) { return m.hypotheses.size() > 1; }),
        2);
    const LoopClosures loops = consistentLoops(matches, drives.chain, {});
    for (const auto& edge : loops.edges) {
      const double error_m = (drives.truth(edge.i, edge.j).inverse() * edge.T_i_j).translation().norm();
      EXPECT_LT(error_m, 0.2 + std::sqrt(edge.covariance(3, 3))) << "key pose " << edge.i;
      EXPECT_LT(sigmas2(edge.T_i_j, edge.covariance, drives.truth(edge.i, edge.j)), kSigma);
    }
    // Now and then the posts of a place run together to one weak match; the others know where they are.
    const auto knows = [](const LoopEdge& edge) { return edge.covariance(3, 3) < 0.4 * 0.4; };
    EXPECT_GE(std::count_if(loops.edges.begin(), loops.edges.end(), knows) + 2,
              static_cast<int>(candidates.size()));
  });
}

TEST(LoopsProperty, WherePostsAreAllThereIsNoLoopIsBelieved) {
  forAll(1, [](Random& rnd) {
    const TwoDrives drives(Corridor{}, {1.5, 0.3, 0}, rnd);
    const LoopClosures loops = consistentLoops(matchAll(drives, drives.candidates(25)), drives.chain, {});
    EXPECT_TRUE(loops.edges.empty());
    for (const auto& refused : loops.refused) EXPECT_EQ(refused.reason, LoopRefusal::ambiguous);
  });
}

TEST(LoopsProperty, AFalseCandidateIsRefused) {
  forAll(1, [](Random& rnd) {
    const TwoDrives drives(corridorWithHouses(rnd, 1), {1, 0.3, 0}, rnd);
    auto candidates = drives.candidates(25);
    const std::size_t half = drives.keys / 2;
    LoopCandidate wrong = drives.between(half, drives.keys + half);
    wrong.i += 20;  // 40 m farther on, believed to be the same place
    candidates.push_back(wrong);
    const LoopClosures loops = consistentLoops(matchAll(drives, candidates), drives.chain, {});
    for (const auto& edge : loops.edges) EXPECT_NE(edge.i, wrong.i);
    ASSERT_FALSE(loops.refused.empty());
    EXPECT_EQ(loops.refused.back().i, wrong.i);
    EXPECT_EQ(loops.refused.back().j, wrong.j);
    EXPECT_THAT(loops.refused.back().reason, ::testing::AnyOf(LoopRefusal::no_match, LoopRefusal::disagrees));
  });
}

TEST(LoopsProperty, WhatNothingHoldsIsWeak) {
  forAll(2, [](Random& rnd) {
    Corridor bare;
    bare.posts = false;
    const TwoDrives drives(bare, {rnd.uniform(-3, 3), 0.2, 0}, rnd);
    const auto match = matchAll(drives, {drives.between(70, drives.keys + 70)}).front();
    ASSERT_FALSE(match.hypotheses.empty());
    const Matrix6d& covariance = match.hypotheses.front().covariance;
    EXPECT_GT(std::sqrt(covariance(3, 3)), 2);    // along the road
    EXPECT_LT(std::sqrt(covariance(4, 4)), 0.5);  // across it
    EXPECT_LT(sigmas2(match.hypotheses.front().T_i_j, covariance, drives.truth(70, drives.keys + 70)),
              kSigma);
  });
}

// ---- Consistency alone: hypotheses made up

/** Places offered for key k of both drives. */
LoopMatch offered(const TwoDrives& drives, std::size_t k, const std::vector<double>& shifts_m, Random& rnd) {
  const std::size_t j = drives.keys + k;
  LoopMatch match{drives.between(k, j), {}, 0.05, 0.9};
  for (const double shift_m : shifts_m) {
    const Pose T = Eigen::Translation3d(shift_m, 0, 0) * drives.truth(k, j);
    Matrix6d covariance = Matrix6d::Zero();
    covariance.diagonal() << 1e-6, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3;
    match.hypotheses.push_back({noisy(T, rnd, 1e-3, 0.03), covariance, 0.05, 0.9});
  }
  return match;
}

TEST(ConsistentLoopsProperty, AnyOrderGivesTheSameAndOutliersAreRefusedByTheirNeighbours) {
  forAll(30, [](Random& rnd) {
    const TwoDrives drives({600, true, {}}, {0, 0, 0}, rnd);
    std::vector<LoopMatch> matches;
    std::vector<std::size_t> outliers;
    for (std::size_t k = 5; k < drives.keys; k += 10) {
      const bool outlier = rnd.uniform(0, 1) < 0.2;
      if (outlier) outliers.push_back(k);
      matches.push_back(offered(drives, k, {outlier ? rnd.oneOf({-4.0, 4.0, 9.0}) : 0}, rnd));
    }
    const LoopClosures loops = consistentLoops(matches, drives.chain, {});
    for (const auto& edge : loops.edges)
      EXPECT_EQ(std::count(outliers.begin(), outliers.end(), edge.i), 0) << "key pose " << edge.i;
    EXPECT_GE(loops.edges.size() + outliers.size() + 1, matches.size());
    for (const auto& refused : loops.refused)
      if (std::count(outliers.begin(), outliers.end(), refused.i) > 0) {
        EXPECT_EQ(refused.reason, LoopRefusal::disagrees);
        EXPECT_GT(refused.off_m, 2);
      }

    std::shuffle(matches.begin(), matches.end(), std::mt19937(7));
    const LoopClosures shuffled = consistentLoops(matches, drives.chain, {});
    ASSERT_EQ(shuffled.edges.size(), loops.edges.size());
    for (const auto& edge : loops.edges)
      EXPECT_TRUE(std::any_of(shuffled.edges.begin(), shuffled.edges.end(), [&](const LoopEdge& other) {
        return other.i == edge.i && other.T_i_j.isApprox(edge.T_i_j, 0);
      }));
  });
}

TEST(ConsistentLoopsProperty, FewUniquePlacesDecideForManyRepeatedOnes) {
  forAll(30, [](Random& rnd) {
    const TwoDrives drives({600, true, {}}, {0, 0, 0}, rnd);
    std::vector<LoopMatch> matches;
    int k_th = 0;
    for (std::size_t k = 5; k < drives.keys;
         k += 10, ++k_th)  // four of thirty tell the posts apart; the best fit misleads
      matches.push_back(
          offered(drives, k, k_th % 8 == 3 ? std::vector<double>{0} : std::vector<double>{4, 0, -4}, rnd));
    const LoopClosures loops = consistentLoops(matches, drives.chain, {});
    EXPECT_GE(loops.edges.size(), matches.size() - 1);
    for (const auto& edge : loops.edges) {
      EXPECT_LT((drives.truth(edge.i, edge.j).inverse() * edge.T_i_j).translation().norm(), 0.3);
    }
  });
}

TEST(ConsistentLoopsProperty, OneLoopAloneIsNotBelieved) {
  forAll(10, [](Random& rnd) {
    const TwoDrives drives({300, true, {}}, {0, 0, 0}, rnd);
    const LoopClosures loops =
        consistentLoops({offered(drives, 20, {0}, rnd), offered(drives, 30, {0}, rnd)}, drives.chain, {});
    EXPECT_TRUE(loops.edges.empty());
    ASSERT_EQ(loops.refused.size(), 2U);
    EXPECT_EQ(loops.refused[0].reason, LoopRefusal::alone);
    EXPECT_THAT(text(loops.refused[0]), ::testing::HasSubstr("key poses 20 and 170: too few neighbours"));
  });
}

// ---- Odometry and candidates

TEST(OdometryChainProperty, AgreesWithStepByStep) {
  forAll(50, [](Random& rnd) {
    OdometryChain chain;
    BodyMotion all;
    for (int k = 0; k < 20; ++k) {
      BodyMotion step;
      step.duration_s = k == 0 ? 0 : 0.1;
      step.T_start_end = k == 0 ? Pose::Identity() : rnd.pose(0.3, 3);
      step.covariance = rnd.uniform(1e-6, 1e-3) * Matrix6d::Identity();
      if (k > 4) all = then(all, step);
      chain.add(step);
    }
    EXPECT_TRUE(chain.T_between(4, 19).isApprox(all.T_start_end, 1e-9));
    EXPECT_TRUE(chain.covarianceBetween(4, 19).isApprox(all.covariance, 1e-9));
    EXPECT_TRUE(chain.T_between(19, 4).isApprox(all.T_start_end.inverse(), 1e-9));
    const Matrix6d ad = adjoint(all.T_start_end);
    EXPECT_TRUE(chain.covarianceBetween(19, 4).isApprox(ad * all.covariance * ad.transpose(), 1e-9));
    chain.add({});
    EXPECT_FALSE(chain.joined(19, 20));
    EXPECT_THROW((void)chain.joined(0, 21), std::out_of_range);
  });
}

TEST(LoopCandidatesProperty, AreOtherPassesOverTheSamePlaceAndBounded) {
  forAll(50, [](Random& rnd) {
    const int n = rnd.integer(50, 300);
    LoopOptions options;
    options.every_ids = rnd.integer(1, 10);
    options.max_per_key = rnd.integer(1, 4);
    options.neighbour_ids = rnd.integer(0, 2);
    RacetrackDict dict(n);
    std::vector<Pose> poses;
    const std::int64_t first = rnd.integer(0, n - 1);
    std::int64_t station = first, tried = 0;
    int session = 0;
    for (std::uint32_t key = 0; key < 2000; ++key) {
      poses.push_back(rnd.pose(3, 100));
      dict.add({key, key}, static_cast<int>(station % n), session);
      const auto candidates = loopCandidates(dict, poses, options);
      EXPECT_LE(candidates.size(), static_cast<std::size_t>(options.max_per_key));
      if (!candidates.empty()) ++tried;
      for (std::size_t c = 0; c < candidates.size(); ++c) {
        EXPECT_EQ(candidates[c].j, key);
        EXPECT_FALSE(dict.samePass(candidates[c].i, key));
        const int away = std::abs(dict.entries()[candidates[c].i].id - dict.entries()[key].id);
        EXPECT_LE(std::min(away, n - away), options.neighbour_ids);
        EXPECT_TRUE(candidates[c].T_i_j.isApprox(poses[candidates[c].i].inverse() * poses[key], 1e-9));
        for (std::size_t other = 0; other < c; ++other)
          EXPECT_FALSE(dict.samePass(candidates[c].i, candidates[other].i));
      }
      station += rnd.integer(0, 1);
      if (key == 1200) ++session;
    }
    const double tries = static_cast<double>(station - first - n) / options.every_ids;
    EXPECT_LE(static_cast<double>(tried), 1.2 * tries + 5);
    EXPECT_GE(static_cast<double>(tried), 0.8 * tries - 5);
  });
}

/** A ring of 3 km, driven three times, with fixes on the first half lap alone. The odometry turns by more than it should,
 * within its covariance: where the first loops are it is off by less than the search reaches, a lap on by more. */
struct RingWithoutFixes {
  static constexpr std::size_t kLap = 300, kLaps = 3;
  std::vector<Pose> truth;
  std::vector<Keyframe> keyframes;
  OdometryChain chain;
  GraphOptions graph;
  LoopOptions loops;

  explicit RingWithoutFixes(Random& rnd) {
    const double step_rad = 2 * M_PI / kLap, radius_m = 10 / step_rad;
    const double stretch = 1 + rnd.oneOf({-1, 1}) * 0.002, wrong_rad = rnd.oneOf({-1, 1}) * 6e-5;
    for (std::size_t k = 0; k < kLap * kLaps; ++k) {
      const double angle_rad = step_rad * static_cast<double>(k);
      truth.push_back(poseFromRpy({radius_m * std::sin(angle_rad), radius_m * (1 - std::cos(angle_rad)), 0},
                                  0, 0, angle_rad));
      Keyframe key{0.2 * static_cast<double>(k), truth.back(), {}};
      if (k > 0) {
        Pose T = truth[k - 1].inverse() * truth[k] * poseFromRpy({0, 0, 0}, 0, 0, wrong_rad);
        T.translation() *= stretch;
        key.T_odom_body = keyframes.back().T_odom_body * T;
        key.since_last = {0.2, T, 1e-8 * Matrix6d::Identity()};
      }
      if (k < kLap / 2)
        key.gps.push_back(
            {"gps", truth[k].translation(), 1e-4 * Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()});
      chain.add({key.since_last.duration_s, key.since_last.T_start_end,
                 flooredOdometry(key.since_last.covariance, graph)});
      keyframes.push_back(key);
    }
    loops.every_ids = 4;
  }

  /** What a LoopMatcher would say. */
  [[nodiscard]] LoopMatch match(const LoopCandidate& candidate, Random& rnd) const {
    const Pose T = truth[candidate.i].inverse() * truth[candidate.j];
    LoopMatch match{candidate, {}, 0.02, 0.9};
    if ((T.translation() - candidate.T_i_j.translation()).head<2>().norm() < candidate.drift_m)
      match.hypotheses.push_back({noisy(T, rnd, 1e-4, 0.01), 1e-4 * Matrix6d::Identity(), 0.02, 0.9});
    return match;
  }

  /** How far from where the lap before was a lap comes out at the same place, at worst.
   * \param bends  whether loops are looked for from the estimate that LoopSearch has bent */
  [[nodiscard]] double worstGap_m(bool bends, Random& rnd) const {
    const std::vector<Pose> before =
        solveGraph(GraphKind::joint, keyframes, {}, alignedOdometry(keyframes), graph).T_map_body;
    std::vector<Eigen::Vector3d> line;
    for (std::size_t k = 0; k < kLap; ++k) line.emplace_back(before[k].translation());
    TrackIdOptions id_options;
    id_options.reach_m = 40;  // the drift is to be beyond the search, not beyond the line
    const TrackIds ids(wayPointsAlong(line, id_options.spacing_m), id_options);
    RacetrackDict dict(ids.count());
    LoopSearch search(graphWithoutLoops(GraphKind::joint, keyframes, before, graph), chain, loops);
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const std::vector<Pose>& T_map_body = bends ? search.T_map_body() : before;
      const auto id = ids.idAt(T_map_body[k]);
      if (!id) continue;
      const auto number = static_cast<std::uint32_t>(k);
      dict.add({number, number}, *id, 0);
      std::vector<LoopMatch> matches;
      for (const auto& candidate : loopCandidates(dict, T_map_body, loops))
        matches.push_back(match(candidate, rnd));
      search.add(matches);
    }
    const auto T_map_body =
        solveGraph(GraphKind::joint, keyframes, search.closures().edges, search.T_map_body(), graph)
            .T_map_body;
    double worst_m = 0;
    for (std::size_t k = kLap; k < truth.size(); ++k)
      worst_m =
          std::max(worst_m, (T_map_body[k - kLap].inverse() * T_map_body[k]).translation().head<2>().norm());
    return worst_m;
  }
};

TEST(LoopSearchProperty, WithoutFixesALapIsFoundFromWhereTheOneBeforeHasClosed) {
  forAll(3, [](Random& rnd) {
    const RingWithoutFixes ring(rnd);
    EXPECT_GT(ring.worstGap_m(false, rnd), 5);
    EXPECT_LT(ring.worstGap_m(true, rnd), 0.3);
  });
}

}  // namespace
}  // namespace raceloc
