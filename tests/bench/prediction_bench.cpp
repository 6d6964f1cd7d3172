/** \file
 * How well the car's own sources predict its motion, and know which way is up: `prediction_bench MAP.ini LOG.rawlog
 * TRUTH.tum`. Scans calibrate them on the way, as in the apps; a prediction knows only what had been learnt when it
 * began. */
#include <iostream>
#include <map>

#include "bench/real_pairs.h"
#include "cli/app.h"
#include "core/statistics.h"
#include "core/trajectory.h"
#include "eval/trajectory_errors.h"
#include "pipeline/mapper.h"

namespace raceloc::bench {
namespace {

struct Begun {
  double stamp_s;
  CalibrationVector calibration;
};

struct Errors {
  std::vector<double> m, deg, share;
};

void run(const std::string& ini, const std::string& log, const std::string& truth_path) {
  const MatchingOptions options = MapperOptions::fromIni(ini).matching;
  const std::vector<StampedPose> truth = readTum(truth_path).poses;
  gpu::Context context(gpu::Backend::cpu, 0, options.device.threads);
  OdometryStream stream = odometryStream(context, options);
  const MotionHistory& history = stream.history();
  LogReader reader(log, options.log, std::nullopt, Late::passed);
  std::vector<Begun> begun;
  std::map<double, Errors> by_horizon_s{{0.1, {}}, {0.5, {}}, {1.0, {}}, {2.0, {}}};
  std::size_t scans = 0, trusted = 0;
  std::vector<double> level_deg;
  const auto judge = [&](double now_s) {
    for (auto& [horizon_s, errors] : by_horizon_s) {
      const double latest_s = now_s - horizon_s + 1e-6;
      const auto from = std::find_if(begun.rbegin(), begun.rend(),
                                     [latest_s](const Begun& b) { return b.stamp_s <= latest_s; });
      if (from == begun.rend() || now_s - from->stamp_s > horizon_s + 0.05) continue;
      const auto motion = history.preintegrated(from->stamp_s, now_s);
      const auto begin = interpolated(truth, from->stamp_s, 0.05), end = interpolated(truth, now_s, 0.05);
      if (!motion || !begin || !end) continue;
      const Pose predicted = motion->corrected(from->calibration - history.calibration().mean());
      const Pose T = begin->inverse() * *end;
      const Vector6d error = se3Log(T.inverse() * predicted);
      errors.m.push_back(error.tail<3>().norm());
      errors.deg.push_back(error.head<3>().norm() / kDegree);
      errors.share.push_back(100 * error.tail<3>().norm() / std::max(1.0, T.translation().norm()));
    }
  };
  while (auto sample = reader.next()) {
    stream.add(std::move(*sample), [&](const OdometryStep& step) {
      ++scans;
      trusted += step.trusted ? 1 : 0;
      judge(step.stamp_s);
      const auto T_true = interpolated(truth, step.stamp_s, 0.05);
      if (step.level && T_true)
        level_deg.push_back(
            std::acos(std::min(1.0, step.level->up_body.dot(T_true->linear().row(2).transpose()))) / kDegree);
      begun.push_back({step.stamp_s, history.calibration().mean()});
    });
  }
  std::cout << scans << " scans, " << trusted << " trusted\n\n"
            << "| seconds | predictions | translation [m]: median | p95 | of the distance [%]: p95 | "
               "rotation [deg]: median | p95 "
               "|\n|---|---|---|---|---|---|---|\n";
  for (const auto& [horizon_s, errors] : by_horizon_s)
    std::cout << "| " << horizon_s << " | " << errors.m.size() << " | " << number(quantile(errors.m, 0.5), 4)
              << " | " << number(quantile(errors.m, 0.95), 4) << " | "
              << number(quantile(errors.share, 0.95), 3) << " | " << number(quantile(errors.deg, 0.5), 4)
              << " | " << number(quantile(errors.deg, 0.95), 4) << " |\n";
  const CalibrationVector c = history.calibration().mean();
  const CalibrationVector sigma = history.calibration().covariance().diagonal().cwiseSqrt();
  std::cout << "\nroll and pitch against gravity: median " << number(quantile(level_deg, 0.5), 3) << ", p95 "
            << number(quantile(level_deg, 0.95), 3) << " deg off in " << level_deg.size() << " scans\n";
  std::cout << "\ncalibration: gyro bias " << c.head<3>().transpose() / kDegree << " (" << sigma(2) / kDegree
            << ") deg/s, wheel scale " << c(kWheelScale) << " (" << sigma(kWheelScale)
            << "), steering offset " << c(kSteeringOffset) / kDegree << " ("
            << sigma(kSteeringOffset) / kDegree << ") deg, side-slip " << c(kSideslip) / kDegree << " ("
            << sigma(kSideslip) / kDegree << ") deg per m/s^2, rise " << c(kRise) / kDegree << " ("
            << sigma(kRise) / kDegree << ") deg\n";
}

}  // namespace
}  // namespace raceloc::bench

int main(int argc, char** argv) {
  return raceloc::runApp("prediction_bench", [&] {
    if (argc != 4) throw raceloc::InputError("usage: prediction_bench MAP.ini LOG.rawlog TRUTH.tum");
    raceloc::bench::run(argv[1], argv[2], argv[3]);
  });
}
