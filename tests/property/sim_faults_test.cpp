#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "core/labels.h"
#include "sim/fault_options.h"
#include "sim/faults.h"
#include "support/forall.h"

namespace raceloc::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kStart_s = 1.7e9;  // as in a log; its doubles are 0.24 us apart

Fault faultOf(FaultKind kind, const std::string& labels = "*", double from_s = 0, double to_s = 0) {
  Fault fault;
  fault.kind = kind;
  fault.labels = labels;
  fault.from_s = from_s;
  fault.to_s = to_s;
  return fault;
}

// ---- A stream of messages ----

GpsFix fixAt(double t_s, const std::string& label, const Eigen::Vector3d& p_m, double course_rad = 0) {
  return {kStart_s + t_s,
          label,
          p_m,
          0.01 * Eigen::Matrix3d::Identity(),
          Eigen::Vector3d::Zero(),
          4,
          GroundVelocity{50, course_rad}};
}

InsPose insAt(double t_s, const std::string& label, const Eigen::Vector3d& p_m, double yaw_rad = 0) {
  Matrix6d cov = 0.01 * Matrix6d::Identity();
  cov(2, 4) = cov(4, 2) = 0.001;
  return {kStart_s + t_s, label, poseFromRpy(p_m, 0.1, 0.02, yaw_rad), cov};
}

Scan scanAt(Random& rnd, double t_s, const std::string& label, int points) {
  Scan scan{kStart_s + t_s, label, rnd.pose(0.3, 2), {}, {}, {}};
  for (int i = 0; i < points; ++i) {
    scan.cloud.push(rnd.vectorWithin(50).cast<float>(), static_cast<float>(rnd.uniform(0, 1)));
    scan.time_s.push_back(0.1f * static_cast<float>(i) / static_cast<float>(points));
    scan.ring.push_back(static_cast<float>(i % 16));
  }
  return scan;
}

/** Ten seconds of two receivers, two LiDARs, IMU and car, in order of arrival. */
std::vector<Delivery> drive(Random& rnd) {
  std::vector<Delivery> messages;
  const auto add = [&](double latency_s, Sample sample) {
    messages.push_back({stampOf(sample) + latency_s + rnd.uniform(0, 0.01), std::move(sample)});
  };
  for (int i = 0; i < 1000; ++i) {
    const double t_s = 0.01 * i;
    add(0.001,
        ImuSample{kStart_s + t_s, "imu", rnd.vectorWithin(1), rnd.vectorWithin(20), rnd.vectorWithin(2)});
    add(0.002, MotionSample{kStart_s + t_s, "vehicle", rnd.uniform(20, 70), rnd.uniform(-0.3, 0.3),
                            rnd.uniform(-0.1, 0.1)});
    if (i % 10 == 0)
      for (const char* label : {"gps_left", "gps_right"}) {
        add(0.05, fixAt(t_s, label, rnd.vectorWithin(1000), rnd.uniform(-3, 3)));
        add(0.05, insAt(t_s, label, rnd.vectorWithin(1000), rnd.uniform(-3, 3)));
      }
    if (i % 20 == 0)
      for (const char* label : {"lidar_left", "lidar_right"}) add(0.1, scanAt(rnd, t_s, label, 40));
  }
  std::stable_sort(messages.begin(), messages.end(),
                   [](const auto& a, const auto& b) { return a.arrival_s < b.arrival_s; });
  return messages;
}

/** Every bit of a message, as text: NaN equals itself, 0 is not -0. */
struct Bits {
  std::ostringstream out;
  template <class Number>
  void raw(const Number* values, std::size_t n) {
    out << n << ':';
    out.write(reinterpret_cast<const char*>(values), static_cast<std::streamsize>(n * sizeof(Number)));
  }
  void add(double v) { raw(&v, 1); }
  void add(const std::vector<float>& v) { raw(v.data(), v.size()); }
  template <class Derived>
  void add(const Eigen::PlainObjectBase<Derived>& m) {
    raw(m.data(), static_cast<std::size_t>(m.size()));
  }
  void operator()(const GpsFix& s) {
    add(s.p_map_antenna_m), add(s.cov_map_m2), add(s.p_body_antenna_m), add(s.fix_quality);
    if (s.velocity) add(s.velocity->speed_mps), add(s.velocity->course_rad);
  }
  void operator()(const InsPose& s) { add(s.T_map_body.matrix()), add(s.covariance); }
  void operator()(const ImuSample& s) { add(s.gyro_body_rps), add(s.specific_force_body_mps2); }
  void operator()(const MotionSample& s) {
    add(s.speed_mps), add(s.yaw_rate_rps);
    if (s.steering_rad) add(*s.steering_rad);
  }
  void operator()(const Scan& s) {
    add(s.T_body_lidar.matrix()), add(s.time_s), add(s.ring);
    for (const auto* v : {&s.cloud.x, &s.cloud.y, &s.cloud.z, &s.cloud.intensity}) add(*v);
  }
};

std::string bitsOf(const std::vector<Delivery>& messages) {
  Bits bits;
  for (const auto& m : messages) {
    bits.add(m.arrival_s), bits.add(stampOf(m.sample));
    bits.out << m.sample.index() << labelOf(m.sample) << '|';
    std::visit(bits, m.sample);
  }
  return bits.out.str();
}

/** What becomes of each message. */
std::vector<std::vector<Delivery>> injected(const std::vector<Fault>& faults,
                                            const std::vector<Delivery>& messages, std::uint64_t seed) {
  FaultInjector injector(faults, kStart_s, seed);
  std::vector<std::vector<Delivery>> results;
  results.reserve(messages.size());
  for (const auto& m : messages) results.push_back(injector.apply(m));
  return results;
}

/** The one message that `fault` makes of a sample. */
template <class T>
T changed(const Fault& fault, const T& sample, std::uint64_t seed = 1) {
  const auto result = FaultInjector({fault}, kStart_s, seed).apply({sample.stamp_s, sample});
  EXPECT_EQ(result.size(), 1u);
  return std::get<T>(result.at(0).sample);
}

bool isRandom(FaultKind kind) {
  const std::set<FaultKind> random = {FaultKind::gps_noise,        FaultKind::gps_rtk_flapping,
                                      FaultKind::message_shuffled, FaultKind::lidar_thinned,
                                      FaultKind::lidar_spray,      FaultKind::lidar_nan};
  return random.count(kind) > 0;
}

std::string prefixOf(FaultKind kind) { return nameOf(kind).substr(0, nameOf(kind).find('_')); }

/** Devices in drive() that the kind can act on. */
std::string devicesOf(FaultKind kind) {
  const std::string prefix = prefixOf(kind);
  if (prefix == "gps" || prefix == "lidar") return prefix + "_*";
  if (prefix == "imu") return "imu";
  return prefix == "message" || prefix == "stamp" ? "*" : "vehicle";
}

// ---- Laws of every kind ----

class EveryKind : public ::testing::TestWithParam<FaultKind> {};
INSTANTIATE_TEST_SUITE_P(Faults, EveryKind, ::testing::ValuesIn(faultKinds()),
                         [](const auto& kind) { return nameOf(kind.param); });

TEST_P(EveryKind, ChangesItsDevicesInItsIntervalAndNotOneBitElse) {
  forAll(10, [&](Random& rnd) {
    const auto messages = drive(rnd);
    const std::string labels =
        rnd.oneOf<std::string>({"*", "*_left imu vehicle", "?ps_right,vehicle lidar_*"});
    const double from_s = rnd.uniform(0, 6);
    const auto fault = faultOf(GetParam(), labels, from_s, rnd.oneOf({0.0, from_s + rnd.uniform(1, 4)}));
    const FaultInjector untouched({fault}, kStart_s, 1);
    const auto results = injected({fault}, messages, 1);

    std::map<std::string, int> changes;
    for (std::size_t i = 0; i < messages.size(); ++i) {
      const auto& m = messages[i];
      const std::string& label = labelOf(m.sample);
      const double t_s = stampOf(m.sample) - kStart_s;
      const bool is_meant = t_s >= from_s && t_s < fault.end_s() && matchesLabel(labels, label);
      EXPECT_EQ(untouched.touches(label, stampOf(m.sample)), is_meant);
      for (const auto& r : results[i]) {
        EXPECT_GE(r.arrival_s, m.arrival_s);
      }
      if (bitsOf(results[i]) == bitsOf({m})) continue;
      ++changes[label];
      EXPECT_TRUE(is_meant) << label << " at " << t_s;
      EXPECT_TRUE(matchesLabel(devicesOf(GetParam()), label)) << label;
    }
    for (const char* label : {"gps_left", "gps_right", "imu", "vehicle", "lidar_left", "lidar_right"}) {
      const bool is_meant = matchesLabel(labels, label) && matchesLabel(devicesOf(GetParam()), label);
      EXPECT_TRUE(!is_meant || changes[label] > 0) << label;
    }
  });
}

TEST_P(EveryKind, IsTheSameForTheSameSeedAndAnotherForAnother) {
  forAll(5, [&](Random& rnd) {
    const auto messages = drive(rnd);
    const auto all = [&](std::uint64_t seed) {
      std::string text;
      for (const auto& r : injected({faultOf(GetParam(), "*", 2, 8)}, messages, seed)) text += bitsOf(r);
      return text;
    };
    EXPECT_TRUE(all(1) == all(1));
    EXPECT_EQ(all(1) != all(2), isRandom(GetParam()));
  });
}

TEST_P(EveryKind, DoesNotDependOnOtherDevices) {
  forAll(5, [&](Random& rnd) {
    const auto messages = drive(rnd);
    const auto fault = faultOf(GetParam(), "*", 2, 8);
    const std::string label = rnd.oneOf<std::string>({"gps_left", "imu", "vehicle", "lidar_right"});
    // gps_vibration is the car's motion's by definition
    const std::string heard = GetParam() == FaultKind::gps_vibration ? label + " vehicle" : label;
    FaultInjector among_all({fault}, kStart_s, 7), alone({fault}, kStart_s, 7);
    for (const auto& m : messages) {
      const auto result = bitsOf(among_all.apply(m));
      if (!matchesLabel(heard, labelOf(m.sample))) continue;
      EXPECT_TRUE(result == bitsOf(alone.apply(m)));
    }
  });
}

TEST_P(EveryKind, KeepsTheArraysOfAScanOfOneLength) {
  forAll(20, [&](Random& rnd) {
    Scan scan = scanAt(rnd, 1, "lidar_left", rnd.integer(0, 50));
    const bool has_intensity = rnd.integer(0, 1) == 1, has_times = rnd.integer(0, 1) == 1;
    if (!has_intensity) scan.cloud.intensity.clear();
    if (!has_times) scan.time_s.clear();
    for (const auto& d : FaultInjector({faultOf(GetParam())}, kStart_s, 1).apply({scan.stamp_s, scan})) {
      const auto& s = std::get<Scan>(d.sample);
      const std::size_t n = s.cloud.size();
      const bool keeps_times = has_times && GetParam() != FaultKind::lidar_times_absent;
      EXPECT_EQ(s.cloud.y.size(), n);
      EXPECT_EQ(s.cloud.z.size(), n);
      EXPECT_EQ(s.cloud.intensity.size(), has_intensity ? n : 0);
      EXPECT_EQ(s.time_s.size(), keeps_times ? n : 0);
      EXPECT_EQ(s.ring.size(), n);
    }
  });
}

TEST_P(EveryKind, IsReadAgainFromItsText) {
  const std::string path = ::testing::TempDir() + "sim_faults_" + nameOf(GetParam()) + ".ini";
  forAll(20, [&](Random& rnd) {
    Fault fault = faultOf(GetParam(), rnd.oneOf<std::string>({"*", "gps_left, lidar_?"}), rnd.uniform(0, 10),
                          rnd.oneOf({0.0, rnd.uniform(10, 20)}));
    fault.section = "fault_07";
    fault.sigma_m = rnd.uniform(0, 10);
    fault.shared = rnd.integer(0, 1) == 1;
    fault.up_m = rnd.normal(1e-9);
    fault.jump_s = rnd.normal(1e5);
    fault.max_m = rnd.uniform(2, 50);
    fault.accelerometer_z_mps2 = rnd.normal();
    Fault other = faultOf(FaultKind::gps_outage);
    other.section = "fault_08";
    std::ofstream(path) << iniText({fault, other});
    EXPECT_EQ(iniText(readFaults(path)), iniText({fault, other}));
  });
  std::filesystem::remove(path);
}

// ---- GPS ----

Eigen::Vector3d errorOfFix(FaultInjector& injector, double t_s, const std::string& label = "gps_left") {
  const auto fix = fixAt(t_s, label, Eigen::Vector3d::Zero());
  return std::get<GpsFix>(injector.apply({fix.stamp_s, fix}).at(0).sample).p_map_antenna_m;
}
Eigen::Vector3d errorOfIns(FaultInjector& injector, double t_s, const std::string& label = "gps_left",
                           double yaw_rad = 0) {
  const auto ins = insAt(t_s, label, Eigen::Vector3d::Zero(), yaw_rad);
  return std::get<InsPose>(injector.apply({ins.stamp_s, ins}).at(0).sample).T_map_body.translation();
}

TEST(GpsFaultProperty, NoiseIsWhiteWithItsSigma) {
  forAll(20, [](Random& rnd) {
    auto fault = faultOf(FaultKind::gps_noise);
    fault.sigma_m = rnd.oneOf({0.01, 5.0, 10.0});
    FaultInjector injector({fault}, kStart_s, static_cast<std::uint64_t>(rnd.integer(0, 1 << 30)));
    const int n = 5000;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero(), squares = sum, products = sum, cross = sum, last = sum;
    for (int i = 0; i < n; ++i) {
      const Eigen::Vector3d e = errorOfFix(injector, 0.05 * i) / fault.sigma_m;
      sum += e;
      squares += e.cwiseAbs2();
      products += e.cwiseProduct(last);                                       // in time
      cross += Eigen::Vector3d(e.x() * e.y(), e.y() * e.z(), e.z() * e.x());  // between the axes
      last = e;
    }
    const double bound = 4.5 / std::sqrt(n);  // sigmas of a mean of n; 240 of them are looked at
    EXPECT_LT((sum / n).cwiseAbs().maxCoeff(), bound);
    EXPECT_LT((products / n).cwiseAbs().maxCoeff(), bound);
    EXPECT_LT((cross / n).cwiseAbs().maxCoeff(), bound);
    EXPECT_LT((squares / n - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff(), bound * std::sqrt(2));
  });
}

TEST(GpsFaultProperty, PositionErrorsAreThoseOfTheReceiverNotOfTheMessage) {
  for (const auto kind : {FaultKind::gps_noise, FaultKind::gps_step, FaultKind::gps_ramp,
                          FaultKind::gps_vibration, FaultKind::gps_rtk_flapping})
    forAll(20, [&](Random& rnd) {
      FaultInjector injector({faultOf(kind)}, kStart_s, 3);
      double largest_m = 0;
      for (int i = 0; i < 100; ++i) {
        const double t_s = 0.1 * i;
        (void)injector.apply(
            {kStart_s + t_s, MotionSample{kStart_s + t_s, "vehicle", 60, rnd.uniform(-0.3, 0.3)}});
        const Eigen::Vector3d of_fix_m = errorOfFix(injector, t_s);
        // side-slip makes the yaw another than the course
        EXPECT_EQ(errorOfIns(injector, t_s, "gps_left", 0.05), of_fix_m) << nameOf(kind);
        largest_m = std::max(largest_m, of_fix_m.norm());
      }
      EXPECT_GT(largest_m, 0);
    });
}

TEST(GpsFaultProperty, SharedNoiseIsThatOfAllReceivers) {
  forAll(50, [](Random& rnd) {
    auto fault = faultOf(FaultKind::gps_noise);
    fault.shared = rnd.integer(0, 1) == 1;
    FaultInjector injector({fault}, kStart_s, 3);
    const double t_s = rnd.uniform(0, 100);
    EXPECT_EQ(errorOfFix(injector, t_s) == errorOfFix(injector, t_s, "gps_right"), fault.shared);
  });
}

TEST(GpsFaultProperty, StepIsExact) {
  forAll(100, [](Random& rnd) {
    auto fault = faultOf(FaultKind::gps_step);
    const Eigen::Vector3d step_m = rnd.vectorWithin(20), p_m = rnd.vectorWithin(1000);
    fault.east_m = step_m.x(), fault.north_m = step_m.y(), fault.up_m = step_m.z();
    EXPECT_EQ(changed(fault, fixAt(rnd.uniform(0, 9), "gps", p_m)).p_map_antenna_m, p_m + step_m);
    const auto ins = insAt(1, "gps", p_m, rnd.uniform(-3, 3));
    EXPECT_EQ(changed(fault, ins).T_map_body.translation(), p_m + step_m);
    EXPECT_EQ(changed(fault, ins).T_map_body.linear(), ins.T_map_body.linear());
  });
}

TEST(GpsFaultProperty, RampGrowsFromNothingAtItsRate) {
  forAll(100, [](Random& rnd) {
    auto fault = faultOf(FaultKind::gps_ramp, "*", rnd.uniform(0, 10), 100);
    fault.rate_mps = rnd.oneOf({0.1, 0.5, 5.0});
    fault.direction_deg = rnd.uniform(-180, 180);
    FaultInjector injector({fault}, kStart_s, 1);
    const double on_for_s = rnd.oneOf({1e-6, rnd.uniform(0, 80)}),
                 direction_rad = fault.direction_deg * M_PI / 180;
    const Eigen::Vector3d expected_m =
        fault.rate_mps * on_for_s * Eigen::Vector3d(std::cos(direction_rad), std::sin(direction_rad), 0);
    // 5 m/s times 0.24 us of the stamp
    EXPECT_LT((errorOfFix(injector, fault.from_s + on_for_s) - expected_m).norm(), 2e-6);
  });
}

TEST(GpsFaultProperty, VibrationGoesLeftInLeftTurnsWithItsLag) {
  forAll(50, [](Random& rnd) {
    auto fault = faultOf(FaultKind::gps_vibration, "*", 2);
    fault.gain_m_per_mps2 = rnd.uniform(-0.2, 0.2);
    fault.time_constant_s = rnd.uniform(0.1, 2);
    FaultInjector injector({fault}, kStart_s, 1);
    const double speed_mps = 60, yaw_rate_rps = rnd.uniform(-0.3, 0.3), period_s = rnd.oneOf({0.02, 0.1});
    (void)injector.apply({kStart_s, MotionSample{kStart_s, "vehicle", 20, 1}});  // before its interval
    const int from = rnd.integer(0, 2);  // how the direction is known: velocity, INS, neither
    for (int i = 0; i < 100; ++i) {
      const double t_s = 2 + period_s * i, course_rad = yaw_rate_rps * t_s;
      (void)injector.apply(
          {kStart_s + t_s, MotionSample{kStart_s + t_s, "vehicle", speed_mps, yaw_rate_rps}});
      // late: the newest sample counts, not the last that came
      (void)injector.apply({kStart_s + t_s, MotionSample{kStart_s + t_s - 0.001, "vehicle", 0, 0}});
      const double radius_m = speed_mps / yaw_rate_rps;
      const Eigen::Vector3d p_m(radius_m * std::sin(course_rad), -radius_m * std::cos(course_rad), 0);
      Eigen::Vector3d error_m;
      if (from == 1) {
        error_m = errorOfIns(injector, t_s, "gps_left", course_rad);
      } else {
        auto fix = fixAt(t_s, "gps_left", p_m, course_rad);
        if (from == 2) fix.velocity.reset();
        const auto result = injector.apply({fix.stamp_s, fix});
        error_m = std::get<GpsFix>(result.at(0).sample).p_map_antenna_m - p_m;
      }
      const double lagged = 1 - std::exp(-period_s * i / fault.time_constant_s);
      // a chord points half a step behind the course
      const double along_rad = course_rad - (from == 2 ? 0.5 * yaw_rate_rps * period_s : 0);
      const Eigen::Vector3d left(-std::sin(along_rad), std::cos(along_rad), 0);
      const Eigen::Vector3d expected_m = fault.gain_m_per_mps2 * speed_mps * yaw_rate_rps * lagged * left;
      EXPECT_LT((error_m - expected_m).norm(), 1e-5) << from << ", " << t_s;  // stamps: 0.24 us of 0.1 s
    }
  });
}

TEST(GpsFaultProperty, OutageLosesFixesAndInsPoses) {
  forAll(10, [](Random& rnd) {
    const auto messages = drive(rnd);
    const auto results = injected({faultOf(FaultKind::gps_outage, "gps_left", 3, 5)}, messages, 1);
    for (std::size_t i = 0; i < messages.size(); ++i) {
      const double t_s = stampOf(messages[i].sample) - kStart_s;
      const bool is_lost = labelOf(messages[i].sample) == "gps_left" && t_s >= 3 && t_s < 5;
      EXPECT_EQ(results[i].size(), is_lost ? 0u : 1u);
    }
  });
}

/** Of `label` within [3, 5) s, each message equals the first of its type there but for its stamp. */
void expectFrozen(FaultKind kind, const std::string& label) {
  forAll(10, [&](Random& rnd) {
    const auto messages = drive(rnd);
    const auto results = injected({faultOf(kind, label, 3, 5)}, messages, 1);
    std::map<std::size_t, Sample> first;
    int repeated = 0;
    for (std::size_t i = 0; i < messages.size(); ++i) {
      const auto& m = messages[i];
      const double t_s = stampOf(m.sample) - kStart_s;
      if (labelOf(m.sample) != label || t_s < 3 || t_s >= 5) continue;
      Delivery expected{m.arrival_s, first.try_emplace(m.sample.index(), m.sample).first->second};
      std::visit([&](auto& s) { s.stamp_s = stampOf(m.sample); }, expected.sample);
      EXPECT_TRUE(bitsOf(results[i]) == bitsOf({expected}));
      ++repeated;
    }
    EXPECT_GT(repeated, 20);
  });
}

TEST(GpsFaultProperty, FrozenRepeatsWithFreshStamps) { expectFrozen(FaultKind::gps_frozen, "gps_right"); }

TEST(GpsFaultProperty, CovarianceIsTheClaimedOneAndStaysSemidefinite) {
  forAll(50, [](Random& rnd) {
    auto fault = faultOf(FaultKind::gps_covariance);
    fault.claimed_sigma_m = rnd.oneOf({0.0, 0.01, rnd.uniform(0, 10)});
    const Eigen::Matrix3d expected_m2 =
        fault.claimed_sigma_m * fault.claimed_sigma_m * Eigen::Matrix3d::Identity();
    const auto fix = fixAt(1, "gps", rnd.vectorWithin(100));
    EXPECT_EQ(changed(fault, fix).cov_map_m2, expected_m2);
    EXPECT_EQ(changed(fault, fix).p_map_antenna_m, fix.p_map_antenna_m);
    const auto ins = insAt(1, "gps", rnd.vectorWithin(100));
    Matrix6d expected = Matrix6d::Zero();
    expected.topLeftCorner<3, 3>() = ins.covariance.topLeftCorner<3, 3>();
    expected.bottomRightCorner<3, 3>() = expected_m2;
    EXPECT_EQ(changed(fault, ins).covariance, expected);
  });
}

TEST(GpsFaultProperty, RtkFlapsBetweenFloatAndFixed) {
  forAll(50, [](Random& rnd) {
    auto fault = faultOf(FaultKind::gps_rtk_flapping, "*", rnd.uniform(0, 5));
    fault.period_s = rnd.uniform(0.5, 3);
    FaultInjector injector({fault}, kStart_s, static_cast<std::uint64_t>(rnd.integer(0, 1 << 30)));
    const int phases = 1000;
    double squares = 0;
    for (int phase = 0; phase < phases; ++phase) {
      const double begin_s = fault.from_s + phase * fault.period_s;
      const double early_s = begin_s + 0.01 * fault.period_s, late_s = begin_s + 0.99 * fault.period_s;
      const Eigen::Vector3d error_m = errorOfFix(injector, early_s);
      EXPECT_EQ(errorOfFix(injector, late_s), error_m);  // held
      const auto fix = fixAt(late_s, "gps_left", Eigen::Vector3d::Zero());
      const auto seen = std::get<GpsFix>(injector.apply({fix.stamp_s, fix}).at(0).sample);
      EXPECT_EQ(seen.fix_quality, phase % 2 == 0 ? 5 : 4);
      EXPECT_EQ(error_m.norm() > 0, phase % 2 == 0);
      const double own_m2 = phase % 2 == 0 ? fault.float_sigma_m * fault.float_sigma_m : 0;
      EXPECT_TRUE(seen.cov_map_m2.isApprox(fix.cov_map_m2 + own_m2 * Eigen::Matrix3d::Identity(), 1e-12));
      squares += error_m.squaredNorm();
    }
    const double n = 3.0 * phases / 2;
    EXPECT_NEAR(squares / n / (fault.float_sigma_m * fault.float_sigma_m), 1, 4 * std::sqrt(2 / n));
  });
}

TEST(GpsFaultProperty, HeadingFlipsByHalfATurnAndTheRestStays) {
  forAll(100, [](Random& rnd) {
    const auto fault = faultOf(FaultKind::gps_heading_flip);
    const double yaw_rad = rnd.uniform(-M_PI, M_PI);
    const auto ins = insAt(1, "gps", rnd.vectorWithin(100), yaw_rad);
    const auto seen = changed(fault, ins);
    EXPECT_NEAR(std::abs(wrapAngle(yawOf(seen.T_map_body) - yaw_rad)), M_PI, 1e-9);
    EXPECT_EQ(seen.T_map_body.translation(), ins.T_map_body.translation());
    EXPECT_EQ(seen.T_map_body.linear().col(2), ins.T_map_body.linear().col(2));
    // the same uncertainty, seen in the map
    Matrix6d to_map = Matrix6d::Zero(), to_map_seen = to_map;
    for (const int i : {0, 3}) {
      to_map.block<3, 3>(i, i) = ins.T_map_body.linear();
      to_map_seen.block<3, 3>(i, i) = seen.T_map_body.linear();
    }
    EXPECT_TRUE((to_map_seen * seen.covariance * to_map_seen.transpose())
                    .isApprox(to_map * ins.covariance * to_map.transpose(), 1e-12));
    const auto fix = fixAt(1, "gps", rnd.vectorWithin(100), yaw_rad);
    EXPECT_NEAR(std::abs(wrapAngle(changed(fault, fix).velocity->course_rad - yaw_rad)), M_PI, 1e-9);
    EXPECT_EQ(changed(fault, fix).p_map_antenna_m, fix.p_map_antenna_m);
  });
}

// ---- Messages ----

TEST(MessageFaultProperty, LateMessagesKeepTheirStamps) {
  forAll(50, [](Random& rnd) {
    auto fault = faultOf(FaultKind::message_late);
    fault.delay_s = rnd.uniform(0, 2);
    FaultInjector injector({fault}, kStart_s, 1);
    const Delivery message{kStart_s + 5, scanAt(rnd, 4.9, "lidar_left", 5)};
    EXPECT_EQ(bitsOf(injector.apply(message)), bitsOf({{message.arrival_s + fault.delay_s, message.sample}}));
  });
}

TEST(MessageFaultProperty, DuplicatesAreEqualAlsoUnderALaterFault) {
  forAll(50, [](Random& rnd) {
    auto twice = faultOf(FaultKind::message_duplicated);
    twice.again_after_s = rnd.oneOf({0.0, 0.02});
    FaultInjector injector({twice, faultOf(FaultKind::gps_noise)}, kStart_s, 1);
    const auto result = injector.apply({kStart_s + 5, fixAt(4.9, "gps", rnd.vectorWithin(100))});
    ASSERT_EQ(result.size(), 2u);
    EXPECT_EQ(result[1].arrival_s, result[0].arrival_s + twice.again_after_s);
    EXPECT_EQ(bitsOf({{0, result[0].sample}}), bitsOf({{0, result[1].sample}}));
  });
}

TEST(MessageFaultProperty, ShuffledDelaysAreUniformAndChangeTheOrder) {
  forAll(20, [](Random& rnd) {
    auto fault = faultOf(FaultKind::message_shuffled);
    fault.window_s = rnd.uniform(0.05, 1);
    FaultInjector injector({fault}, kStart_s, static_cast<std::uint64_t>(rnd.integer(0, 1 << 30)));
    const int n = 3000;
    double sum = 0, squares = 0, last_s = 0;
    int overtaken = 0;
    for (int i = 0; i < n; ++i) {
      const double stamp_s = kStart_s + 0.01 * i;
      const auto result =
          injector.apply({stamp_s, ImuSample{stamp_s, "imu", {0, 0, 1}, {0, 0, 9.81}, {0, 0, 0}}});
      const double share = (result.at(0).arrival_s - stamp_s) / fault.window_s;
      sum += share;
      squares += (share - 0.5) * (share - 0.5);
      overtaken += result.at(0).arrival_s < last_s;
      last_s = result.at(0).arrival_s;
      EXPECT_LE(share, 1 + 1e-5);  // 0.24 us of 0.05 s
    }
    EXPECT_NEAR(sum / n, 0.5, 4 * std::sqrt(1.0 / 12 / n));
    EXPECT_NEAR(squares / n, 1.0 / 12, 4 * std::sqrt(1.0 / 180 / n));
    EXPECT_GT(overtaken, n / 10);
  });
}

TEST(MessageFaultProperty, StampJumpMovesTheStampAloneAndLaterFaultsGoByTheTrueOne) {
  forAll(50, [](Random& rnd) {
    auto jump = faultOf(FaultKind::stamp_jump, "*", 4, 6);
    jump.jump_s = rnd.uniform(-50, 50);
    const auto step = faultOf(FaultKind::gps_step, "*", 4, 6);
    FaultInjector injector({jump, step}, kStart_s, 1);
    auto expected = fixAt(5, "gps", rnd.vectorWithin(100));
    const auto result = injector.apply({kStart_s + 5.1, expected});
    expected.stamp_s += jump.jump_s;
    expected.p_map_antenna_m.x() += step.east_m;
    EXPECT_EQ(bitsOf(result), bitsOf({{kStart_s + 5.1, expected}}));
  });
}

// ---- LiDAR ----

TEST(LidarFaultProperty, ThinnedLosesItsShareAndKeepsThePointsTogether) {
  forAll(20, [](Random& rnd) {
    auto fault = faultOf(FaultKind::lidar_thinned);
    fault.lost_share = rnd.oneOf({0.0, 1.0, 0.5, rnd.uniform(0, 1)});
    const int n = 5000;
    const auto scan = scanAt(rnd, rnd.uniform(0, 9), "lidar", n);
    const auto seen = changed(fault, scan);
    const double share = fault.lost_share;
    EXPECT_NEAR(1 - static_cast<double>(seen.cloud.size()) / n, share,
                4 * std::sqrt(share * (1 - share) / n));
    std::size_t i = 0;  // a subsequence of the points as they were, every field with its own
    for (std::size_t k = 0; k < seen.cloud.size(); ++k, ++i) {
      while (i < scan.cloud.size() && scan.time_s[i] != seen.time_s[k]) ++i;
      ASSERT_LT(i, scan.cloud.size());
      EXPECT_EQ(seen.cloud.point(k), scan.cloud.point(i));
      EXPECT_EQ(seen.cloud.intensity[k], scan.cloud.intensity[i]);
      EXPECT_EQ(seen.ring[k], scan.ring[i]);
    }
  });
}

TEST(LidarFaultProperty, SprayIsOnTheRaysAtItsRanges) {
  forAll(20, [](Random& rnd) {
    auto fault = faultOf(FaultKind::lidar_spray);
    fault.spray_share = rnd.uniform(0, 1);
    fault.min_m = rnd.uniform(0.1, 5);
    fault.max_m = fault.min_m + rnd.uniform(0, 20);
    const int n = 5000;
    auto scan = scanAt(rnd, 1, "lidar", n);
    scan.cloud.x[0] = scan.cloud.y[0] = scan.cloud.z[0] = 0;  // no ray
    const auto seen = changed(fault, scan);
    ASSERT_EQ(seen.cloud.size(), scan.cloud.size());
    EXPECT_EQ(seen.cloud.point(0), scan.cloud.point(0));
    int drops = 0;
    double mean_m = 0;
    for (std::size_t i = 1; i < seen.cloud.size(); ++i) {
      if (seen.cloud.point(i) == scan.cloud.point(i)) continue;
      ++drops;
      const double range_m = seen.cloud.point(i).norm();
      mean_m += range_m;
      EXPECT_GE(range_m, fault.min_m - 1e-4);  // float at 25 m
      EXPECT_LE(range_m, fault.max_m + 1e-4);
      EXPECT_LT((seen.cloud.point(i).normalized() - scan.cloud.point(i).normalized()).norm(), 1e-5f);
    }
    const double share = fault.spray_share;
    EXPECT_NEAR(static_cast<double>(drops) / n, share, 4 * std::sqrt(share * (1 - share) / n) + 1.0 / n);
    // of the mean of uniform ranges, and float at 25 m
    const double sigma_m = (fault.max_m - fault.min_m) / std::sqrt(12.0 * std::max(drops, 1));
    EXPECT_NEAR(mean_m / std::max(drops, 1), 0.5 * (fault.min_m + fault.max_m), 4.5 * sigma_m + 1e-4);
  });
}

TEST(LidarFaultProperty, ABlockedSectorIsEmptyAndTheRestIsThere) {
  forAll(50, [](Random& rnd) {
    auto fault = faultOf(FaultKind::lidar_sector_blocked);
    fault.sector_from_deg = rnd.oneOf({-180.0, 150.0, rnd.uniform(-180, 180)});
    fault.sector_to_deg = rnd.oneOf({180.0, -150.0, rnd.uniform(-180, 180)});
    const auto scan = scanAt(rnd, 1, "lidar", 500);
    std::vector<float> kept_s;
    for (std::size_t i = 0; i < scan.cloud.size(); ++i) {
      const double azimuth_deg = std::atan2(scan.cloud.y[i], scan.cloud.x[i]) * 180 / M_PI;
      const double from_deg = fault.sector_from_deg, to_deg = fault.sector_to_deg;
      const bool is_blocked = from_deg < to_deg ? azimuth_deg >= from_deg && azimuth_deg <= to_deg
                                                : azimuth_deg >= from_deg || azimuth_deg <= to_deg;
      if (!is_blocked) kept_s.push_back(scan.time_s[i]);
    }
    EXPECT_EQ(changed(fault, scan).time_s, kept_s);
  });
}

TEST(LidarFaultProperty, TimesAreScaledReversedOrAbsent) {
  forAll(50, [](Random& rnd) {
    const auto scan = scanAt(rnd, 1, "lidar", 100);
    auto scaled = faultOf(FaultKind::lidar_times_scaled);
    scaled.time_factor = rnd.oneOf({0.0, 1.0, 2.0, 0.5});
    const auto scaled_s = changed(scaled, scan).time_s;
    const auto reversed_s = changed(faultOf(FaultKind::lidar_times_reversed), scan).time_s;
    for (std::size_t i = 0; i < 100; ++i) {
      EXPECT_EQ(scaled_s[i], scan.time_s[i] * static_cast<float>(scaled.time_factor));
      EXPECT_NEAR(reversed_s[i], scan.time_s[99 - i], 1e-7);  // float at 0.1 s
    }
    EXPECT_TRUE(changed(faultOf(FaultKind::lidar_times_absent), scan).time_s.empty());
    auto without = scan;
    without.time_s.clear();
    EXPECT_TRUE(changed(faultOf(FaultKind::lidar_times_reversed), without).time_s.empty());
  });
}

TEST(LidarFaultProperty, NanPointsAreTheirShare) {
  forAll(20, [](Random& rnd) {
    auto fault = faultOf(FaultKind::lidar_nan);
    fault.nan_share = rnd.oneOf({0.0, 1.0, rnd.uniform(0, 1)});
    const int n = 5000;
    const auto scan = scanAt(rnd, 1, "lidar", n);
    const auto seen = changed(fault, scan);
    ASSERT_EQ(seen.cloud.size(), scan.cloud.size());
    int lost = 0;
    for (std::size_t i = 0; i < seen.cloud.size(); ++i) {
      const bool is_nan = std::isnan(seen.cloud.x[i]);
      EXPECT_TRUE(is_nan ? seen.cloud.point(i).array().isNaN().all()
                         : seen.cloud.point(i) == scan.cloud.point(i));
      lost += is_nan;
    }
    const double share = fault.nan_share;
    EXPECT_NEAR(static_cast<double>(lost) / n, share, 4 * std::sqrt(share * (1 - share) / n));
  });
}

TEST(LidarFaultProperty, GroundOnlyIsLowInTheBodyFrame) {
  forAll(50, [](Random& rnd) {
    auto fault = faultOf(FaultKind::lidar_ground_only);
    fault.height_m = rnd.uniform(-5, 5);
    const auto scan = scanAt(rnd, 1, "lidar", 300);
    const auto body = transformed(scan.cloud, scan.T_body_lidar);
    std::vector<float> low_s;
    for (std::size_t i = 0; i < body.size(); ++i) {
      if (std::abs(body.z[i] - fault.height_m) < 1e-4) return;  // float at 50 m: either would do
      if (body.z[i] < fault.height_m) low_s.push_back(scan.time_s[i]);
    }
    EXPECT_EQ(changed(fault, scan).time_s, low_s);
  });
}

TEST(LidarFaultProperty, OffLosesTheScans) {
  forAll(20, [](Random& rnd) {
    FaultInjector injector({faultOf(FaultKind::lidar_off, "lidar_left", 2, 2.3)}, kStart_s, 1);
    for (const char* label : {"lidar_left", "lidar_right"})
      for (const double t_s : {1.999, 2.0, rnd.uniform(2, 2.299), 2.301}) {
        const bool is_lost = std::string(label) == "lidar_left" && t_s >= 2 && t_s < 2.3;
        EXPECT_EQ(injector.apply({kStart_s + t_s, scanAt(rnd, t_s, label, 3)}).empty(), is_lost) << t_s;
      }
  });
}

// ---- IMU and car ----

TEST(ImuFaultProperty, BiasIsAddedAndSaturationClamps) {
  forAll(50, [](Random& rnd) {
    const ImuSample imu{kStart_s, "imu", rnd.vectorWithin(1), rnd.vectorWithin(30), rnd.vectorWithin(2)};
    auto bias = faultOf(FaultKind::imu_bias_step);
    const Eigen::Vector3d gyro_dps = rnd.vectorWithin(5), acc_mps2 = rnd.vectorWithin(2);
    bias.gyro_x_dps = gyro_dps.x(), bias.gyro_y_dps = gyro_dps.y(), bias.gyro_z_dps = gyro_dps.z();
    bias.accelerometer_x_mps2 = acc_mps2.x(), bias.accelerometer_y_mps2 = acc_mps2.y();
    bias.accelerometer_z_mps2 = acc_mps2.z();
    const auto biased = changed(bias, imu);
    EXPECT_LT((biased.gyro_body_rps - imu.gyro_body_rps - gyro_dps * M_PI / 180).norm(), 1e-12);
    EXPECT_LT((biased.specific_force_body_mps2 - imu.specific_force_body_mps2 - acc_mps2).norm(), 1e-12);

    const auto limits = faultOf(FaultKind::imu_saturated);
    const auto clamped = changed(limits, imu);
    for (int i = 0; i < 3; ++i) {
      const double gyro_rps = limits.gyro_limit_dps * M_PI / 180,
                   force_mps2 = limits.accelerometer_limit_mps2;
      EXPECT_EQ(clamped.gyro_body_rps[i], std::clamp(imu.gyro_body_rps[i], -gyro_rps, gyro_rps));
      EXPECT_EQ(clamped.specific_force_body_mps2[i],
                std::clamp(imu.specific_force_body_mps2[i], -force_mps2, force_mps2));
    }
  });
}

TEST(ImuFaultProperty, FrozenRepeatsWithFreshStamps) { expectFrozen(FaultKind::imu_frozen, "imu"); }
TEST(VehicleFaultProperty, FrozenRepeatsWithFreshStamps) {
  expectFrozen(FaultKind::vehicle_frozen, "vehicle");
}

TEST(VehicleFaultProperty, WheelsLockOrSpinAndSteeringIsOff) {
  forAll(50, [](Random& rnd) {
    MotionSample motion{kStart_s, "vehicle", rnd.uniform(-5, 70), rnd.normal(), rnd.normal(0.1)};
    EXPECT_EQ(changed(faultOf(FaultKind::wheel_lock), motion).speed_mps, 0);
    EXPECT_EQ(changed(faultOf(FaultKind::wheel_spin), motion).speed_mps, motion.speed_mps * 1.2);
    auto offset = faultOf(FaultKind::steering_offset);
    offset.offset_deg = rnd.uniform(-10, 10);
    const auto seen = changed(offset, motion);
    EXPECT_NEAR(*seen.steering_rad - *motion.steering_rad, offset.offset_deg * M_PI / 180, 1e-15);
    EXPECT_EQ(seen.speed_mps, motion.speed_mps);
    EXPECT_EQ(seen.yaw_rate_rps, motion.yaw_rate_rps);
    motion.steering_rad.reset();
    EXPECT_FALSE(changed(offset, motion).steering_rad);
  });
}

// ---- Faults together ----

TEST(FaultsProperty, DelaysAddUpToTheLargestOne) {
  forAll(20, [](Random& rnd) {
    const auto messages = drive(rnd);
    std::vector<Fault> faults = {faultOf(FaultKind::message_late), faultOf(FaultKind::message_shuffled),
                                 faultOf(FaultKind::message_duplicated, "gps_*")};
    faults[2].again_after_s = 0.02;
    const double most_s = faults[0].delay_s + faults[1].window_s + faults[2].again_after_s;
    const auto results = injected(faults, messages, 1);
    for (std::size_t i = 0; i < messages.size(); ++i)
      for (const auto& r : results[i]) EXPECT_LE(r.arrival_s, messages[i].arrival_s + most_s + 1e-6);
  });
}

TEST(FaultsProperty, TwoOfOneKindHaveNumbersOfTheirOwn) {
  auto first = faultOf(FaultKind::gps_noise, "*", 0, 10), second = first;
  second.section = "fault_02";
  FaultInjector one({first}, kStart_s, 1), other({second}, kStart_s, 1);
  EXPECT_NE(errorOfFix(one, 1), errorOfFix(other, 1));
}

// ---- Ini files ----

/** What readFaults() says of a text. */
std::string complaint(const std::string& text) {
  const std::string path = ::testing::TempDir() + "sim_faults_bad.ini";
  std::ofstream(path) << text;
  try {
    (void)readFaults(path);
  } catch (const InputError& e) {
    std::filesystem::remove(path);
    return e.what();
  }
  return "nothing";
}

TEST(FaultIni, ErrorsNameFileSectionKeyAndValue) {
  const auto says = [](const std::string& text, const std::vector<std::string>& parts) {
    const std::string what = complaint(text);
    for (const auto& part : parts) EXPECT_THAT(what, AllOf(HasSubstr("sim_faults_bad.ini"), HasSubstr(part)));
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
  };
  says("[fault_01]\nkind = gps_stpe\n", {"[fault_01]", "kind = gps_stpe", "did you mean gps_step?"});
  says("[fault_01]\nkind = x\n", {"[fault_01]", "kind = x", "known: gps_noise, "});
  says("[fault_01]\nfrom_s = 3\n", {"[fault_01]", "no key kind", "gps_noise"});
  says("[fault_01]\nkind = gps_outage\n[fault_02]\nkind = gps_step\nsigma_m = 5\n",
       {"[fault_02]", "unknown key sigma_m"});
  says("[fault_01]\nkind = gps_noise\nsigma_m = five\n", {"[fault_01]", "sigma_m = five", ">= 0"});
  says("[fault_01]\nkind = gps_noise\nsigma_m = -5\n", {"[fault_01]", "sigma_m = -5", ">= 0"});
  says("[fault_01]\nkind = gps_noise\nsigma_m = nan\n", {"[fault_01]", "sigma_m = nan", ">= 0"});
  says("[fault_01]\nkind = lidar_nan\nnan_share = 1.5\n", {"[fault_01]", "nan_share = 1.5", "0 .. 1"});
  says("[fault_01]\nkind = gps_outage\nfrom_s = 20\nto_s = 5\n", {"[fault_01]", "to_s = 5", "from_s = 20"});
  says("[fault_01]\nkind = gps_outage\nfrom_s = 20\nto_s = 20\n", {"[fault_01]", "to_s = 20", "from_s = 20"});
  says("[fault_01]\nkind = lidar_spray\nmin_m = 9\nmax_m = 8\n", {"[fault_01]", "max_m = 8", "min_m = 9"});
  says("[fault_01]\nkind = lidar_sector_blocked\nsector_from_deg = 30\n",
       {"[fault_01]", "sector_to_deg = 30", "sector_from_deg = 30"});
  says("[falt_01]\nkind = gps_step\n", {"no section [fault_...]", "falt_01"});
  says("", {"no section [fault_...]"});
  says("[fault_01]\nkind = gps_step\n[sensors]\na = 1\n", {"unknown section [sensors]"});
  EXPECT_THROW((void)readFaults("/nowhere/faults.ini"), InputError);
}

const std::vector<DeviceName> kIndy = {
    {"gps_left", "gps"},      {"gps_right", "gps"},    {"imu", "imu"},          {"vehicle", "vehicle"},
    {"lidar_front", "lidar"}, {"lidar_left", "lidar"}, {"lidar_right", "lidar"}};
const std::vector<DeviceName> kRoadCar = {{"gps_top", "gps"},      {"imu", "imu"},
                                          {"vehicle", "vehicle"},  {"lidar_top", "lidar"},
                                          {"lidar_left", "lidar"}, {"lidar_right", "lidar"}};

TEST(FaultIni, AFaultForNoDeviceIsAnErrorThatListsThem) {
  const auto says = [](FaultKind kind, const std::string& labels, const std::string& list) {
    auto fault = faultOf(kind, labels);
    fault.section = "fault_02";
    try {
      requireDevices({faultOf(FaultKind::gps_step), fault}, "F.ini", kIndy);
      FAIL() << labels;
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(),
                  AllOf(HasSubstr("faults F.ini, section [fault_02]: labels = " + labels), HasSubstr(list)));
    }
  };
  says(FaultKind::gps_step, "gps_rear", "(GPS labels: gps_left, gps_right)");
  says(FaultKind::gps_step, "lidar_left", "(GPS labels: gps_left, gps_right)");
  says(FaultKind::wheel_lock, "car", "(vehicle labels: vehicle)");
  says(FaultKind::message_late, "camera", "gps_right, imu, vehicle, lidar_front");
  says(FaultKind::imu_frozen, "", "(IMU labels: imu)");
  says(FaultKind::lidar_off, "lidar_left gps_rear", "called gps_rear (LiDAR labels");  // each has to fit
  requireDevices(
      {faultOf(FaultKind::message_late, "imu"), faultOf(FaultKind::lidar_off, "lidar_r* lidar_left")},
      "F.ini", kIndy);
  EXPECT_THROW(requireDevices({faultOf(FaultKind::gps_step)}, "F.ini", {{"imu", "imu"}}), InputError);
}

TEST(FaultIni, ShippedOnesAreReadFitBothCarsAndExplainEveryKeyAsTheCodeDoes) {
  std::set<FaultKind> seen;
  for (const auto& file : std::filesystem::directory_iterator(RACELOC_ROOT "/ini/sim/faults")) {
    SCOPED_TRACE(file.path().string());
    const auto faults = readFaults(file.path());
    for (const auto& car : {kIndy, kRoadCar}) EXPECT_NO_THROW(requireDevices(faults, file.path(), car));
    for (const auto& fault : faults) seen.insert(fault.kind);

    std::vector<std::string> own;  // without the words at the top
    std::ifstream in(file.path());
    for (std::string line; std::getline(in, line);)
      if (!own.empty() || line == "[fault_01]") own.push_back(line.substr(0, line.find("; default ")));
    std::vector<std::string> generated;
    std::istringstream text(iniText(faults));
    for (std::string line; std::getline(text, line);) generated.push_back(line);
    EXPECT_EQ(own, generated);
  }
  EXPECT_EQ(seen.size(), faultKinds().size());  // each kind can be tried
}

}  // namespace
}  // namespace raceloc::test
