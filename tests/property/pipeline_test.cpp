/** \file
 * The localizer, driven down a street of known points: given ..., when ..., then .... */
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <functional>

#include "cloud/deskew.h"
#include "cloud/voxel_grid.h"
#include "core/errors.h"
#include "map/map_file.h"
#include "pipeline/localizer.h"
#include "pipeline/map_quality.h"
#include "support/room.h"

namespace raceloc {
namespace {

using test::Random;

constexpr double kSpeed_mps = 10, kYawRate_rps = 0.02, kEnd_s = 4;
const Eigen::Vector3d kLever_m(1.0, 0.2, 1.2);

Pose truthAt(double stamp_s) {
  return poseFromRpy({-25, -1, 0.3}, 0, 0, 0.02) * arc(kSpeed_mps * stamp_s, kYawRate_rps * stamp_s);
}

/** What may be done to a sample on its way to the localizer: changed, or dropped (false). */
using Fault = std::function<bool(Sample&, Random&)>;
bool none(Sample& /*sample*/, Random& /*rnd*/) { return true; }

class LocalizerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ =
        std::filesystem::temp_directory_path() / ("raceloc_localizer_" + std::to_string(getpid()) + ".rlmap");
    saveMapOf(street_);
  }
  void saveMapOf(const Cloud& surveyed) {
    TiledMap tiles(32);
    CovarianceOptions dense;
    dense.radius_m = 0.6;
    const CovarianceCloud map = withCovariances(context_, voxelGrid(context_, surveyed, 0.2), dense);
    tiles.insert(map.cloud, map.covariances.view());
    saveMap(path_, tiles, {{GeodeticPoint{49, 8, 100}, 32, 0.2, "test", "", {"survey"}}, {}});
  }
  void TearDown() override { std::filesystem::remove(path_); }

  std::vector<LocalizerOutput> drive(const Fault& fault, unsigned seed = 1, const TrialOptions& trial = {}) {
    Random rnd(seed);
    const MapFile map(path_);
    LocalizerOptions options;
    options.trial = trial;
    options.matching.crop = {0, 80, 0, 0, 0};
    options.matching.registration = registration_;
    Localizer localizer(context_, map, options);
    std::vector<LocalizerOutput> outputs;
    const auto hand = [&](Sample sample) {
      if (!fault(sample, rnd)) return;
      for (auto& output : localizer.add(sample)) {
        if (localizer.isMatching()) ++while_matching_;
        outputs.push_back(std::move(output));
      }
    };
    for (int i = 0; i <= 100 * kEnd_s; ++i) {
      const double stamp_s = 0.01 * i;
      const Pose T = truthAt(stamp_s);
      if (i % 5 == 0) {
        hand(InsPose{stamp_s, "gps_a", T, 1e-6 * Matrix6d::Identity()});
        const Eigen::Vector3d noise_m(rnd.normal(0.02), rnd.normal(0.02), rnd.normal(0.02));
        hand(GpsFix{stamp_s, "gps_a", T * kLever_m + noise_m, 4e-4 * Eigen::Matrix3d::Identity(), kLever_m,
                    4});
      }
      hand(MotionSample{stamp_s, "vehicle", kSpeed_mps, kYawRate_rps});
      if (i % 10 == 0)
        hand(Scan{stamp_s,
                  "lidar",
                  Pose::Identity(),
                  voxelGrid(scanner_, transformed(street_, T.inverse()), 0.5),
                  {},
                  {}});
    }
    for (auto& output : localizer.finish()) outputs.push_back(std::move(output));
    start_ = localizer.startReport();
    searches_ = localizer.searches();
    return outputs;
  }

  static double worstError_m(const std::vector<LocalizerOutput>& outputs) {
    double worst_m = 0;
    for (const auto& output : outputs)
      worst_m =
          std::max(worst_m, (output.T_map_body.translation() - truthAt(output.stamp_s).translation()).norm());
    return worst_m;
  }
  static std::size_t alarms(const std::vector<LocalizerOutput>& outputs) {
    return static_cast<std::size_t>(std::count_if(outputs.begin(), outputs.end(), [](const auto& o) {
      return o.decision && o.decision->decision.alarm;
    }));
  }

  Random rnd_{21};
  gpu::Context context_{gpu::Backend::cpu}, scanner_{gpu::Backend::cpu};
  Cloud street_ = test::street(rnd_, 0.01, 40000);
  std::string path_;
  GicpOptions registration_;
  std::optional<StartReport> start_;
  std::size_t searches_ = 0, while_matching_ = 0;
};

/** 1 cm point noise, 1 m voxels, 0.2 m between map points: a match is good to some centimetres. */
constexpr double kMatch_m = 0.08;

TEST_F(LocalizerTest, GivenAllSourcesItFollowsTheCar) {
  const auto outputs = drive(none);
  ASSERT_GE(outputs.size(), 38U);
  EXPECT_LT(worstError_m(outputs), kMatch_m);
  EXPECT_EQ(alarms(outputs), 0U);
  ASSERT_TRUE(start_);
  EXPECT_TRUE(start_->by_match);
  for (std::size_t i = 1; i < outputs.size(); ++i) EXPECT_GT(outputs[i].stamp_s, outputs[i - 1].stamp_s);
}

TEST_F(LocalizerTest, WhenTheGpsLiesFromTheFirstFixOnItIsRejected) {
  const auto outputs = drive([](Sample& sample, Random& rnd) {
    if (auto* fix = std::get_if<GpsFix>(&sample))
      fix->p_map_antenna_m += Eigen::Vector3d(rnd.oneOf({-1, 1}) * rnd.uniform(6, 12), rnd.normal(2), 0);
    return true;
  });
  EXPECT_LT(worstError_m(outputs), kMatch_m);
  int decisions = 0;
  for (const auto& output : outputs) {
    if (!output.decision) continue;
    ++decisions;
    for (const auto& verdict : output.decision->decision.sources)
      EXPECT_EQ(verdict.accepted, verdict.source == "scan_match") << output.stamp_s;
  }
  EXPECT_GT(decisions, 30);
}

TEST_F(LocalizerTest, AStreetThatLooksAlikeIsNotTakenForTheOneOfTheFix) {
  const Cloud beside = transformed(street_, Pose(Eigen::Translation3d(0, 20, 0)));
  Cloud two;
  for (std::size_t i = 0; i < street_.size(); ++i) {
    two.push(beside.point(i));
    if (street_.x[i] < 20) two.push(street_.point(i));  // not surveyed to its end: the one beside fits better
  }
  saveMapOf(two);
  const auto outputs = drive(none);
  ASSERT_TRUE(start_ && start_->by_match);
  EXPECT_LT(start_->match_to_fix_m, kMatch_m + 0.06);  // and three sigmas of the fix
  EXPECT_LT(worstError_m(outputs), kMatch_m);
}

TEST_F(LocalizerTest, BesideASureFixAMatchThatGoesOnAlongItsWeakestDirectionIsNotLookedForElsewhere) {
  registration_.translation_epsilon_m = registration_.rotation_epsilon_deg = 1e-12;  // none comes to rest
  static_cast<void>(drive(none));
  ASSERT_TRUE(start_ && start_->by_match);
  EXPECT_LT(start_->match_to_fix_m, kMatch_m + 0.06);  // and three sigmas of the fix
}

TEST_F(LocalizerTest, AFixThatLiesFromTheFirstOnDoesNotHoldTheStartWhereAnotherPlaceFitsBetter) {
  for (const double lie_m : {4, 8, 12, 16, 20}) {
    static_cast<void>(drive([lie_m](Sample& sample, Random&) {
      if (auto* fix = std::get_if<GpsFix>(&sample)) fix->p_map_antenna_m.x() += lie_m;  // and claims 2 cm
      return true;
    }));
    ASSERT_TRUE(start_ && start_->by_match) << lie_m;
    EXPECT_NEAR(start_->match_to_fix_m, lie_m, kMatch_m + 0.06) << lie_m;
  }
}

TEST_F(LocalizerTest, WhenTheGpsStopsTheMatchCarriesOn) {
  const auto outputs =
      drive([](Sample& sample, Random&) { return stampOf(sample) < 1 || labelOf(sample) != "gps_a"; });
  EXPECT_NEAR(outputs.back().stamp_s, kEnd_s, 0.11 + LocalizerPolicy().match_delay_s);
  EXPECT_LT(worstError_m(outputs), kMatch_m);
}

TEST_F(LocalizerTest, WhenTheLidarStopsTheGpsCarriesOn) {
  const auto outputs = drive(
      [](Sample& sample, Random&) { return stampOf(sample) < 1 || !std::holds_alternative<Scan>(sample); });
  EXPECT_NEAR(outputs.back().stamp_s, kEnd_s, 0.06);
  EXPECT_LT(worstError_m(outputs), 0.15);  // 3 sigma of 2 cm on two axes, on top of the last match
  EXPECT_EQ(outputs.back().faults.count("LiDAR lidar: silent"), 1U);
}

TEST_F(LocalizerTest, WhenAllSourcesStopItDeadReckons) {
  const auto outputs = drive([](Sample& sample, Random&) {
    return stampOf(sample) < 1 || std::holds_alternative<MotionSample>(sample);
  });
  EXPECT_NEAR(outputs.back().stamp_s, kEnd_s, 0.3);
  EXPECT_FALSE(outputs.back().decision);
  EXPECT_LT(worstError_m(outputs), kMatch_m + 0.01 * 3 * kSpeed_mps);  // 1 % of 30 m
  const auto sigma_m = [](const LocalizerOutput& o) { return std::sqrt(o.covariance(3, 3)); };
  EXPECT_GT(sigma_m(outputs.back()), 2 * sigma_m(outputs.front()));  // and knows that it knows less
}

TEST_F(LocalizerTest, WhenAllSourcesLieTheAlarmIsUp) {
  const auto outputs = drive([](Sample& sample, Random&) {
    if (stampOf(sample) < 1) return true;
    if (auto* fix = std::get_if<GpsFix>(&sample)) fix->p_map_antenna_m.x() += 30;
    return !std::holds_alternative<Scan>(sample);
  });
  EXPECT_GT(alarms(outputs), 10U);
  EXPECT_LT(worstError_m(outputs), kMatch_m + 0.01 * 3 * kSpeed_mps);
}

TEST_F(LocalizerTest, WhenTheWheelsFallSilentItGoesOnAndSaysSo) {
  const auto outputs = drive([](Sample& sample, Random&) {
    return stampOf(sample) < 1 || !std::holds_alternative<MotionSample>(sample);
  });
  EXPECT_NEAR(outputs.back().stamp_s, kEnd_s, 0.11 + LocalizerPolicy().match_delay_s);
  EXPECT_LT(worstError_m(outputs), kMatch_m);
  EXPECT_TRUE(outputs.front().by_wheels);
  EXPECT_FALSE(outputs.back().by_wheels);
}

TEST_F(LocalizerTest, BeforeItHasAHeadingItSaysNothing) {
  const auto outputs = drive([](Sample& sample, Random&) {
    if (auto* fix = std::get_if<GpsFix>(&sample))
      fix->p_map_antenna_m = truthAt(0) * kLever_m;  // it stands still
    return !std::holds_alternative<InsPose>(sample);
  });
  EXPECT_TRUE(outputs.empty());
  EXPECT_FALSE(start_);
}

TEST_F(LocalizerTest, WithoutAnInsTheCourseStartsIt) {
  const auto outputs =
      drive([](Sample& sample, Random&) { return !std::holds_alternative<InsPose>(sample); });
  ASSERT_TRUE(start_);
  EXPECT_LT(worstError_m(outputs), kMatch_m);
}

TEST_F(LocalizerTest, AnEstimateComesWithEachMessageOfTheCarsMotion) {
  const auto outputs = drive(none);
  ASSERT_GT(outputs.size(), 300U);
  for (std::size_t i = 1; i + 1 < outputs.size(); ++i)  // the last one is for the last match
    EXPECT_NEAR(outputs[i].stamp_s - outputs[i - 1].stamp_s, 0.01, 1e-9);
  EXPECT_EQ(outputs.back().integrity.state, LocalizationState::ok);
  EXPECT_NEAR(outputs.back().speed_mps, kSpeed_mps, 0.1);
}

TEST_F(LocalizerTest, EstimatesGoOnWhileAMatchIsMade) {
  const auto outputs = drive(none);
  EXPECT_GE(while_matching_, 80U);  // 0.03 s: two of the ten of each sweep, at the least
  std::size_t sweeps = 0, matches = 0;
  for (const auto& output : outputs) {
    if (output.walls) ++sweeps;
    if (output.scan_match) ++matches;
  }
  EXPECT_EQ(sweeps, 40U);  // all but the first one, with which it starts; the last one, too
  EXPECT_EQ(matches, 41U);
}

TEST_F(LocalizerTest, ASweepThatIsDeliveredLateIsNotWaitedFor) {
  const MapFile map(path_);
  LocalizerOptions options;
  options.matching.crop = {0, 80, 0, 0, 0};
  Localizer localizer(context_, map, options);
  Random rnd(3);
  std::optional<Sample> sweep;
  int whole = 0;
  for (int i = 0; i <= 200; ++i) {
    const double stamp_s = 0.01 * i;
    const Pose T = truthAt(stamp_s);
    if (i % 5 == 0) {
      (void)localizer.add(InsPose{stamp_s, "gps_a", T, 1e-6 * Matrix6d::Identity()});
      (void)localizer.add(
          GpsFix{stamp_s, "gps_a", T * kLever_m, 4e-4 * Eigen::Matrix3d::Identity(), kLever_m, 4});
    }
    (void)localizer.add(MotionSample{stamp_s, "vehicle", kSpeed_mps, kYawRate_rps});
    if (i % 10 == 0) {  // stamped at its begin; all of its points are of its end, which is now
      Cloud cloud = voxelGrid(scanner_, transformed(street_, T.inverse()), 0.5);
      std::vector<float> time_s(cloud.size(), 0.1F);
      time_s.front() = 0;
      sweep = Scan{stamp_s - 0.1, "lidar", Pose::Identity(), std::move(cloud), std::move(time_s), {}};
    }
    if (i % 10 == 8 && sweep) {
      (void)localizer.add(*sweep);
      if (!localizer.started() || i < 50) continue;
      EXPECT_TRUE(localizer.isMatching()) << stamp_s;
      (void)localizer.add(
          GpsFix{stamp_s - 0.3, "gps_b", T * kLever_m, Eigen::Matrix3d::Identity(), kLever_m, 4});
      EXPECT_TRUE(localizer.isMatching()) << "a late fix is no reason to wait for it";
      ++whole;
    }
  }
  EXPECT_GT(whole, 10);
}

TEST_F(LocalizerTest, WhatComesLateCountsAsIfItHadBeenInTime) {
  std::vector<Sample> waiting;
  const MapFile map(path_);
  LocalizerOptions options;
  options.matching.crop = {0, 80, 0, 0, 0};
  gpu::Context other{gpu::Backend::cpu};
  Localizer in_time(context_, map, options), late(other, map, options);
  Random rnd(3);
  Pose last = Pose::Identity(), last_late = Pose::Identity();
  for (int i = 0; i <= 300; ++i) {
    const double stamp_s = 0.01 * i;
    const Pose T = truthAt(stamp_s);
    std::vector<Sample> now;
    if (i % 5 == 0) {
      now.emplace_back(InsPose{stamp_s, "gps_a", T, 1e-6 * Matrix6d::Identity()});
      now.emplace_back(GpsFix{stamp_s, "gps_a", T * kLever_m + 0.02 * rnd.vectorWithin(1),
                              4e-4 * Eigen::Matrix3d::Identity(), kLever_m, 4});
    }
    now.emplace_back(MotionSample{stamp_s, "vehicle", kSpeed_mps, kYawRate_rps});
    if (i % 10 == 0)
      now.emplace_back(Scan{stamp_s,
                            "lidar",
                            Pose::Identity(),
                            voxelGrid(scanner_, transformed(street_, T.inverse()), 0.5),
                            {},
                            {}});
    for (const auto& sample : now) {
      for (const auto& output : in_time.add(sample)) last = output.T_map_body;
      if (i > 100 && std::holds_alternative<GpsFix>(sample)) {
        waiting.push_back(sample);  // from then on, each fix comes 0.3 s late
        continue;
      }
      for (const auto& output : late.add(sample)) last_late = output.T_map_body;
    }
    while (!waiting.empty() && stampOf(waiting.front()) <= stamp_s - 0.3) {
      for (const auto& output : late.add(waiting.front())) EXPECT_THAT(output.faults, ::testing::IsEmpty());
      waiting.erase(waiting.begin());
    }
  }
  // The last 0.3 s of fixes, of 0.1 m each beside matches of 0.03 m, are still missing.
  EXPECT_LT((last.translation() - last_late.translation()).norm(), 0.03);
  EXPECT_LT((last_late.translation() - truthAt(3.0).translation()).norm(), kMatch_m);
}

TEST_F(LocalizerTest, AtEachSweepItSeesTheWallAndIsLocalized) {
  int sweeps = 0;
  for (const auto& output : drive(none)) {
    if (!output.walls) continue;
    ++sweeps;
    const WallScan& walls = output.walls->walls;
    const Pose T = truthAt(walls.stamp_s);
    ASSERT_TRUE(walls.right) << walls.stamp_s;
    // 1 cm of noise on the points, and cells of 0.5 m in which posts stand before the wall.
    EXPECT_NEAR(walls.right->distance_m(), (T.translation().y() + 8) / std::cos(yawOf(T)), 0.05)
        << walls.stamp_s;
    EXPECT_EQ(output.walls->guard.state, GuardState::localized);
  }
  EXPECT_GT(sweeps, 35);
}

TEST_F(LocalizerTest, WhenAllSourcesLieTheGuardFollowsTheWall) {
  const auto outputs = drive(none, 1, {"*", 10, 1.0, 1});
  const double reject_s = GuardOptions().reject_s;
  int followed = 0;
  for (const auto& output : outputs) {
    if (!output.walls) continue;
    const double t = output.walls->walls.stamp_s - start_->stamp_s;
    const GuardOutput& guard = output.walls->guard;
    if (t < 1.0) {
      EXPECT_EQ(guard.state, GuardState::localized) << t;
    }
    // Two sweeps until no source confirms it any more, reject_s, and one sweep until it is seen.
    if (t < 1.3 + reject_s) continue;
    EXPECT_EQ(guard.state, GuardState::wall_following) << t;
    EXPECT_TRUE(guard.path);
    ++followed;
  }
  EXPECT_GT(followed, 15);
}

TEST_F(LocalizerTest, AWeekNumberThatRollsOverIsNamed) {
  const auto outputs = drive([](Sample& sample, Random&) {
    if (auto* fix = std::get_if<GpsFix>(&sample); fix && fix->stamp_s > 1)
      fix->stamp_s -= 1024 * 7 * 86'400.0;
    return true;
  });
  EXPECT_LT(worstError_m(outputs), kMatch_m);
  EXPECT_TRUE(std::any_of(outputs.begin(), outputs.end(), [](const LocalizerOutput& output) {
    return output.faults.count("gps_a: the week number of its GPS time has rolled over") > 0;
  }));
}

TEST_F(LocalizerTest, WhenMatchesFailItLooksForTheCarAroundAFix) {
  const auto outputs = drive([](Sample& sample, Random& rnd) {
    if (auto* scan = std::get_if<Scan>(&sample); scan && scan->stamp_s > 1 && scan->stamp_s < 2.5) {
      scan->cloud.clear();
      for (int i = 0; i < 500; ++i) scan->cloud.push((30 * rnd.vectorWithin(1)).cast<float>());
    }
    return true;
  });
  EXPECT_GT(searches_, 0U);
  EXPECT_LT(worstError_m(outputs), 0.15);  // by the receiver meanwhile: 3 sigma of 2 cm on two axes, on top
  EXPECT_EQ(outputs.back().integrity.state, LocalizationState::ok);
}

TEST_F(LocalizerTest, TheSameDriveGivesTheSameBitsWithAnyNumberOfThreads) {
  const auto once = drive(none);
  context_ = gpu::Context(gpu::Backend::cpu, 0, 3);
  const auto again = drive(none);
  ASSERT_EQ(once.size(), again.size());
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].T_map_body.matrix(), again[i].T_map_body.matrix());
    EXPECT_EQ(once[i].covariance, again[i].covariance);
    ASSERT_EQ(once[i].walls.has_value(), again[i].walls.has_value());
    if (!once[i].walls || !once[i].walls->walls.right) continue;
    EXPECT_EQ(once[i].walls->walls.right->beta, again[i].walls->walls.right->beta);
  }
}

WallThickness thicknessOf(const Cloud& cloud) {
  WallSharpness sharpness;
  sharpness.add(cloud);
  return sharpness.thickness();
}

TEST(WallThicknessProperty, IsTheSpreadAcrossTheWall) {
  Random rnd(9);
  Cloud wall;
  constexpr double kSigma_m = 0.03;
  for (int i = 0; i < 40000; ++i) {
    const double along_m = rnd.uniform(-10, 10);
    wall.push(Eigen::Vector3d(0.8 * along_m, 0.6 * along_m, rnd.uniform(0, 3)).cast<float>() +
              (Eigen::Vector3d(-0.6, 0.8, 0) * rnd.normal(kSigma_m)).cast<float>());
  }
  const WallThickness measured = thicknessOf(wall);
  EXPECT_GT(measured.cells, 50U);
  EXPECT_NEAR(measured.median_m, kSigma_m,
              0.2 * kSigma_m);  // cells cut a slanted wall: some take part of its depth
}

TEST(WallThickness, GroundIsNoWall) {
  Random rnd(10);
  Cloud ground;
  for (int i = 0; i < 20000; ++i)
    ground.push(Eigen::Vector3d(rnd.uniform(-5, 5), rnd.uniform(-5, 5), rnd.normal(0.01)).cast<float>());
  EXPECT_EQ(thicknessOf(ground).cells, 0U);
  EXPECT_EQ(thicknessOf({}).cells, 0U);
}

}  // namespace
}  // namespace raceloc
