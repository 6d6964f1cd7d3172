/** \file
 * Laws of libs/sensors: frames of the earth, covariances, logs that come back as they were written. */
#include <gmock/gmock.h>
#include <mrpt/obs/CObservation.h>
#include <unistd.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include "core/errors.h"
#include "sensors/gps_conversion.h"
#include "sensors/message_reader.h"
#include "sensors/pose_conversion.h"
#include "sensors/rawlog.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

class SensorsProperty : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder = std::filesystem::temp_directory_path() /
             ("raceloc_" + std::to_string(::getpid()) + "_" + info->test_suite_name() + "_" + info->name());
    std::filesystem::create_directories(folder);
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  [[nodiscard]] std::string log() const { return (folder / "x.rawlog").string(); }
  std::filesystem::path folder;
};
using RawlogProperty = SensorsProperty;

GeodeticPoint anywhere(Random& rnd) {
  return {rnd.oneOf({-89.0, -60.0, -1e-9, 0.0, 36.0, 49.0, 70.0}) + rnd.uniform(-0.9, 0.9),
          rnd.oneOf({-179.5, -86.0, 0.0, 8.0, 179.5}) + rnd.uniform(-0.4, 0.4), rnd.uniform(-100, 3000)};
}

Matrix6d anyCovariance(Random& rnd) {
  Matrix6d A;
  for (int i = 0; i < 36; ++i) A(i) = rnd.normal(0.1);
  return A * A.transpose() + 1e-6 * Matrix6d::Identity();
}

// ---- Frames

TEST(GpsConversionProperty, ThereAndBack) {
  forAll(300, [](Random& rnd) {
    const GeodeticPoint origin = anywhere(rnd);
    const double size_m = rnd.oneOf({10.0, 5'000.0, 50'000.0});
    const Eigen::Vector3d p_m(rnd.uniform(-size_m, size_m), rnd.uniform(-size_m, size_m),
                              rnd.uniform(-500, 500));
    // MRPT's closed-form latitude: 0.05 mm within some kilometres; the promise is 0.1 mm
    EXPECT_LT((toMap(fromMap(p_m, origin), origin) - p_m).norm(), 1e-4);
  });
}

TEST(GpsConversionProperty, MapFramesCompose) {
  forAll(200, [](Random& rnd) {
    const GeodeticPoint a = anywhere(rnd);
    const GeodeticPoint b = fromMap(rnd.vectorWithin(20'000), a);
    const GeodeticPoint c = fromMap(rnd.vectorWithin(20'000), a);
    const Eigen::Vector3d p_c_m = rnd.vectorWithin(1000);
    const Eigen::Vector3d direct = mapFromMap(a, c) * p_c_m;
    EXPECT_LT((mapFromMap(a, b) * mapFromMap(b, c) * p_c_m - direct).norm(), 1e-7);  // doubles at 6.4e6 m
    EXPECT_LT((mapFromMap(c, a) * direct - p_c_m).norm(), 1e-7);
    EXPECT_TRUE(mapFromMap(a, a).matrix() == Eigen::Matrix4d::Identity());
  });
}

TEST(GpsConversionProperty, MapFramesMoveGeodeticPoints) {
  forAll(200, [](Random& rnd) {
    const GeodeticPoint a = anywhere(rnd);
    const GeodeticPoint b = fromMap(rnd.vectorWithin(20'000), a);
    const GeodeticPoint point = fromMap(rnd.vectorWithin(5'000), a);
    EXPECT_LT((mapFromMap(a, b) * toMap(point, b) - toMap(point, a)).norm(),
              1e-6);  // doubles at 6.4e6 m, twice
  });
}

// ---- Covariances of poses

/** x y z yaw pitch roll, read off the matrix by the definition R = Rz Ry Rx. */
Vector6d coordinatesOf(const Pose& T) {
  const auto& R = T.linear();
  Vector6d c;
  c << T.translation(), std::atan2(R(1, 0), R(0, 0)), std::asin(-R(2, 0)), std::atan2(R(2, 1), R(2, 2));
  return c;
}

TEST(PoseCovarianceProperty, IsTheDerivativeOfTheCoordinates) {
  forAll(200, [](Random& rnd) {
    const Pose T = poseFromRpy(rnd.vectorWithin(100), rnd.uniform(-0.6, 0.6), rnd.uniform(-1.2, 1.2),
                               rnd.uniform(-2.9, 2.9));
    Matrix6d J;  // of the coordinates by the right increment, by central differences
    constexpr double kStep = 1e-5;
    for (int i = 0; i < 6; ++i) {
      const Vector6d xi = kStep * Vector6d::Unit(i);
      J.col(i) = (coordinatesOf(T * se3Exp(xi)) - coordinatesOf(T * se3Exp(-xi))) / (2 * kStep);
    }
    const Matrix6d covariance = anyCovariance(rnd);
    const Matrix6d expected = J * covariance * J.transpose();
    EXPECT_LT((covarianceToMrpt(T, covariance) - expected).norm(),
              1e-7 * expected.norm());  // differences: 1e-9
  });
}

TEST(PoseCovarianceProperty, ThereAndBack) {
  forAll(200, [](Random& rnd) {
    const Pose T =
        poseFromRpy(rnd.vectorWithin(100), rnd.uniform(-3, 3), rnd.uniform(-1.4, 1.4), rnd.uniform(-3, 3));
    const Matrix6d covariance = anyCovariance(rnd);
    EXPECT_LT((covarianceFromMrpt(T, covarianceToMrpt(T, covariance)) - covariance).norm(), 1e-11);
  });
}

// ---- Logs

std::vector<Sample> readAll(LogReader& reader) {
  std::vector<Sample> samples;
  while (auto sample = reader.next()) samples.push_back(std::move(*sample));
  return samples;
}

TEST_F(RawlogProperty, ScansComeBack) {
  forAll(30, [&](Random& rnd) {
    Scan scan{1.7e9 + rnd.uniform(0, 1e6), "lidar_a", rnd.pose(3, 2), {}, {}, {}};
    const bool has_intensity = rnd.integer(0, 1) == 1;
    const bool has_times = rnd.integer(0, 1) == 1;
    const bool has_rings = rnd.integer(0, 1) == 1;
    const int n = rnd.oneOf({0, 1, 500});
    for (int i = 0; i < n; ++i) {
      scan.cloud.push(rnd.vectorWithin(200).cast<float>());
      if (has_intensity) scan.cloud.intensity.push_back(static_cast<float>(rnd.uniform(0, 1)));
      if (has_times) scan.time_s.push_back(static_cast<float>(rnd.uniform(0, 0.1)));
      if (has_rings) scan.ring.push_back(static_cast<float>(rnd.integer(0, 127)));
    }
    {
      LogWriter writer(log(), {}, rnd.integer(0, 1));
      writer.write(scan);
      writer.commit();
    }
    LogReader reader(log(), {});
    const auto samples = readAll(reader);
    ASSERT_EQ(samples.size(), 1U);
    const auto& read = std::get<Scan>(samples[0]);
    EXPECT_EQ(read.label, scan.label);
    EXPECT_NEAR(read.stamp_s, scan.stamp_s, 0.75e-6);  // half a microsecond, and a double at 1.7e9
    EXPECT_LT((read.T_body_lidar.matrix() - scan.T_body_lidar.matrix()).norm(), 1e-12);
    ASSERT_EQ(read.cloud.size(), scan.cloud.size());
    EXPECT_EQ(read.cloud.intensity, scan.cloud.intensity);
    EXPECT_EQ(read.ring, scan.ring);
    ASSERT_EQ(read.time_s.size(), scan.time_s.size());
    for (std::size_t i = 0; i < read.cloud.size(); ++i) {
      const Eigen::Vector3f error = (read.cloud.point(i) - scan.cloud.point(i)).cwiseAbs();
      ASSERT_LE(error.maxCoeff(), 0.5F / 512 + 1e-5F);  // half a step, and a float at 200 m
      if (has_times) {
        ASSERT_NEAR(read.time_s[i], scan.time_s[i], 0.5 / 131072 + 1e-9);
      }
    }
  });
}

TEST_F(RawlogProperty, FixesComeBackInAnyMapFrame) {
  forAll(60, [&](Random& rnd) {
    const GeodeticPoint origin = anywhere(rnd);
    const GeodeticPoint other = fromMap(rnd.vectorWithin(3000), origin);
    const Eigen::Vector3d sigmas_m(rnd.uniform(0.01, 5), rnd.uniform(0.01, 5), rnd.uniform(0.01, 5));
    const GpsFix fix{1.7e9 + 0.25,
                     "gps_left",
                     rnd.vectorWithin(3000),
                     sigmas_m.cwiseAbs2().asDiagonal(),
                     rnd.vectorWithin(2),
                     rnd.oneOf({1, 2, 4, 5, 6}),
                     GroundVelocity{rnd.uniform(0, 90), rnd.uniform(-4, 4)}};
    const InsPose ins{fix.stamp_s, "gps_left",
                      poseFromRpy(rnd.vectorWithin(3000), rnd.uniform(-0.3, 0.3), rnd.uniform(-0.3, 0.3),
                                  rnd.uniform(-3, 3)),
                      anyCovariance(rnd)};
    {
      LogWriter writer(log(), {origin, "// a log\n"});
      writer.write(ins);
      writer.write(fix);
      writer.commit();
    }
    for (const GeodeticPoint& map : {origin, other}) {
      LogReader reader(log(), {}, map);
      const auto samples = readAll(reader);
      ASSERT_EQ(samples.size(), 2U);
      const Pose T_map_origin = mapFromMap(map, origin);

      const auto& pose = std::get<InsPose>(samples[0]);  // written first, and so read first
      EXPECT_EQ(pose.label, ins.label);
      EXPECT_EQ(pose.stamp_s, ins.stamp_s);
      EXPECT_LT((pose.T_map_body.matrix() - (T_map_origin * ins.T_map_body).matrix()).norm(), 1e-6);
      EXPECT_LT((pose.covariance - ins.covariance).norm(),
                1e-10);  // of a right increment: the frame does not matter

      const auto& read = std::get<GpsFix>(samples[1]);
      EXPECT_EQ(read.label, fix.label);
      EXPECT_EQ(read.stamp_s, fix.stamp_s);
      EXPECT_EQ(read.fix_quality, fix.fix_quality);
      EXPECT_LT((read.p_map_antenna_m - T_map_origin * fix.p_map_antenna_m).norm(),
                1e-4);  // as fromMap() promises
      EXPECT_LT((read.p_body_antenna_m - fix.p_body_antenna_m).norm(), 1e-12);
      ASSERT_TRUE(read.velocity);
      EXPECT_NEAR(read.velocity->speed_mps, fix.velocity->speed_mps, 1e-9);
      const double turn_rad = read.velocity->course_rad - fix.velocity->course_rad - yawOf(T_map_origin);
      const bool same_frame = T_map_origin.matrix().isIdentity(0);
      EXPECT_NEAR(std::remainder(turn_rad, 2 * M_PI), 0,
                  same_frame ? 1e-9 : 1e-5);  // tilts of up to 1 mrad, squared, and what they add up to
      // Off-diagonal terms at the fix are not kept; frames within 6 km turn by 1 mrad, near the poles by more
      // about the vertical. So compare what every frame shares: the eigenvalues, up to twice the loss.
      const auto eigenvalues = [](const Eigen::Matrix3d& m) {
        return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues().eval();
      };
      if (std::abs(origin.latitude_deg) < 80) {
        EXPECT_LT((eigenvalues(read.cov_map_m2) - eigenvalues(fix.cov_map_m2)).norm(),
                  0.02 * fix.cov_map_m2.norm());
      }
      EXPECT_LT((read.cov_map_m2 - read.cov_map_m2.transpose()).norm(), 1e-9);
    }
  });
}

TEST_F(RawlogProperty, AFixWithoutVelocityHasNone) {
  forAll(20, [&](Random& rnd) {
    const GpsFix fix{1.7e9, "gps", rnd.vectorWithin(100), Eigen::Matrix3d::Identity(), rnd.vectorWithin(2),
                     4};
    {
      LogWriter writer(log(), {anywhere(rnd), ""});
      writer.write(fix);
      writer.commit();
    }
    LogReader reader(log(), {});
    EXPECT_FALSE(std::get<GpsFix>(*reader.next()).velocity);
  });
}

/** Samples of every kind, in any order of time. */
std::vector<Sample> anySamples(Random& rnd, int count) {
  std::vector<Sample> samples;
  for (int i = 0; i < count; ++i) {
    const double stamp_s = 1e9 + rnd.integer(0, 300) * 0.01;
    const std::string label = rnd.oneOf<std::string>({"a", "b"});
    switch (rnd.integer(0, 5)) {
      case 0:
        samples.emplace_back(MotionSample{stamp_s, label, rnd.uniform(0, 90), rnd.normal()});
        break;
      case 1:
        samples.emplace_back(
            MotionSample{stamp_s, label, rnd.uniform(0, 90), rnd.normal(), rnd.uniform(-0.4, 0.4)});
        break;
      case 2:
        samples.emplace_back(
            ImuSample{stamp_s, label, rnd.vectorWithin(3), rnd.vectorWithin(30), rnd.vectorWithin(2)});
        break;
      case 3:
        samples.emplace_back(InsPose{stamp_s, label, rnd.pose(1, 100), anyCovariance(rnd)});
        break;
      case 4:
        samples.emplace_back(GpsFix{stamp_s, label, rnd.vectorWithin(100), Eigen::Matrix3d::Identity(),
                                    rnd.vectorWithin(2), 4});
        break;
      default:
        samples.emplace_back(Scan{stamp_s, label, rnd.pose(1, 2), {{1}, {2}, {3}, {}}, {}, {}});
    }
  }
  return samples;
}

TEST_F(RawlogProperty, MessagesAreTheSamplesAsTheyWereWritten) {
  forAll(40, [&](Random& rnd) {
    const auto written = anySamples(rnd, 40);
    {
      LogWriter writer(log(), {anywhere(rnd), "// a log\n"}, 0);
      for (const auto& sample : written) writer.write(sample);
      writer.commit();
    }
    MessageReader reader(log());
    for (const auto& sample : written) {
      const auto message = reader.next([](const LogMessage& m) { return m.label == "a"; });
      ASSERT_TRUE(message);
      EXPECT_EQ(message->label, labelOf(sample));
      EXPECT_NEAR(message->stamp_s, stampOf(sample), 2.4e-7);  // two steps of a double at 1e9
      const auto* motion = std::get_if<MotionSample>(&sample);
      EXPECT_EQ(message->originals.size(), motion && motion->steering_rad ? 2U : 1U);
      ASSERT_EQ(message->sample.has_value(), labelOf(sample) == "a");
      if (!message->sample) continue;
      ASSERT_EQ(message->sample->index(), sample.index());
      if (motion) {
        EXPECT_EQ(std::get<MotionSample>(*message->sample).speed_mps, motion->speed_mps);
        EXPECT_EQ(std::get<MotionSample>(*message->sample).steering_rad, motion->steering_rad);
      }
    }
    EXPECT_FALSE(reader.next());
    EXPECT_GT(reader.progress(), 0.99);
  });
}

TEST_F(RawlogProperty, OriginalsMakeTheSameLogAgain) {
  const auto bytesOf = [](const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  forAll(20, [&](Random& rnd) {
    {
      LogWriter writer(log(), {anywhere(rnd), "// a log\n"}, 0);
      for (const auto& sample : anySamples(rnd, 40)) writer.write(sample);
      writer.writePose(1e9, "truth", rnd.pose(1, 100));
      writer.commit();
    }
    const std::string copy = (folder / "copy.rawlog").string();
    MessageReader reader(log());
    LogWriter writer(copy, reader.header(), 0);
    while (const auto message = reader.next())
      for (const auto& original : message->originals) writer.write(*original);
    writer.commit();
    EXPECT_EQ(bytesOf(copy), bytesOf(log()));
  });
}

TEST_F(RawlogProperty, RestComesBackExactly) {
  forAll(40, [&](Random& rnd) {
    const double stamp_s = 1.7e9 + rnd.integer(0, 1'000'000) * 1e-6;
    const ImuSample imu{stamp_s, "imu_a", rnd.vectorWithin(3), rnd.vectorWithin(30), rnd.vectorWithin(2)};
    MotionSample motion{stamp_s, "vehicle", rnd.uniform(-5, 90), rnd.uniform(-1, 1)};
    if (rnd.integer(0, 1) == 1) motion.steering_rad = rnd.uniform(-0.4, 0.4);
    {
      LogWriter writer(log(), {});
      writer.write(imu);
      writer.write(motion);
      writer.commit();
    }
    LogReader reader(log(), {});
    const auto samples = readAll(reader);
    ASSERT_EQ(samples.size(), 2U);
    const auto& read_imu = std::get<ImuSample>(samples[0]);
    EXPECT_NEAR(read_imu.stamp_s, stamp_s, 2.4e-7);  // one step of a double at 1.7e9
    EXPECT_LT((read_imu.gyro_body_rps - imu.gyro_body_rps).norm(), 1e-15);
    EXPECT_LT((read_imu.specific_force_body_mps2 - imu.specific_force_body_mps2).norm(), 1e-14);
    EXPECT_LT((read_imu.p_body_imu_m - imu.p_body_imu_m).norm(), 1e-15);
    const auto& read_motion = std::get<MotionSample>(samples[1]);
    EXPECT_EQ(read_motion.label, motion.label);
    EXPECT_EQ(read_motion.speed_mps, motion.speed_mps);
    EXPECT_EQ(read_motion.yaw_rate_rps, motion.yaw_rate_rps);
    EXPECT_EQ(read_motion.steering_rad, motion.steering_rad);
  });
}

/** Samples of several devices, each late by up to `delay_s`, as they arrive at a recorder. */
std::vector<MotionSample> arrivals(Random& rnd, double delay_s) {
  std::multimap<double, MotionSample> by_arrival;
  for (int i = 0; i < 60; ++i) {
    const MotionSample sample{1e9 + rnd.integer(0, 300) * 0.01, "v" + std::to_string(rnd.integer(1, 3)),
                              1.0 * i, 0};
    by_arrival.emplace(sample.stamp_s + rnd.uniform(0, delay_s), sample);
  }
  std::vector<MotionSample> samples;
  for (const auto& arrival : by_arrival) samples.push_back(arrival.second);
  return samples;
}

void writeLog(const std::string& path, const std::vector<MotionSample>& samples) {
  LogWriter writer(path, {}, 0);
  for (const auto& sample : samples) writer.write(sample);
  writer.commit();
}

TEST_F(RawlogProperty, TheWindowSortsWhatIsLateByLess) {
  forAll(60, [&](Random& rnd) {
    auto expected = arrivals(rnd, 0.5);
    writeLog(log(), expected);
    std::stable_sort(expected.begin(), expected.end(),
                     [](const auto& a, const auto& b) { return a.stamp_s < b.stamp_s; });
    LogOptions options;
    options.reorder_window_s = 0.5;
    LogReader reader(log(), options);
    const auto samples = readAll(reader);
    EXPECT_EQ(reader.droppedLate(), 0U);
    EXPECT_TRUE(reader.leftOut().empty());
    ASSERT_EQ(samples.size(), expected.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
      EXPECT_EQ(stampOf(samples[i]), expected[i].stamp_s);
      EXPECT_EQ(std::get<MotionSample>(samples[i]).speed_mps,
                expected[i].speed_mps);  // equal stamps keep their order
    }
  });
}

TEST_F(RawlogProperty, WhatIsLaterIsCountedAndOrderHoldsAnyway) {
  forAll(60, [&](Random& rnd) {
    const auto written = arrivals(rnd, 2);
    writeLog(log(), written);
    LogOptions options;
    options.reorder_window_s = rnd.oneOf({0.0, 0.1, 0.5});
    LogReader reader(log(), options);
    const auto samples = readAll(reader);
    std::size_t left_out = 0;
    for (const auto& of_label : reader.leftOut()) left_out += of_label.second;
    EXPECT_EQ(samples.size() + reader.droppedLate() + left_out, written.size());
    for (std::size_t i = 1; i < samples.size(); ++i) EXPECT_LE(stampOf(samples[i - 1]), stampOf(samples[i]));
  });
}

TEST_F(RawlogProperty, ACutLogNeverReadsAsAWholeOne) {
  std::vector<MotionSample> samples;
  samples.reserve(200);
  Random source(7);
  for (int i = 0; i < 200; ++i)
    samples.push_back({1e9 + 0.01 * i, "vehicle", source.normal(), source.normal()});
  writeLog(log(), samples);  // at level 0: bytes as they come, so that some cuts fall between two objects
  const auto whole = std::filesystem::file_size(log());
  forAll(100, [&](Random& rnd) {
    const std::string cut = (folder / "cut.rawlog").string();
    std::filesystem::copy_file(log(), cut, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(
        cut, static_cast<std::uintmax_t>(rnd.uniform(0.02, 0.98) * static_cast<double>(whole)));
    EXPECT_THROW(static_cast<void>(summarizeRawlog(cut)), InputError);
  });
}

}  // namespace
}  // namespace raceloc
