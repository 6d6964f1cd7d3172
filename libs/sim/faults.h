/** \file
 * Faults put into a stream of messages, simulated or recorded: the same code for both. */
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sim/delivery.h"
#include "sim/fault_options.h"
#include "sim/noise.h"

namespace raceloc {

/** Changes the messages whose stamps lie in [from_s, to_s) of a fault, and not one bit of any other. Faults
 * act one after another in the order given, each by the stamp that the message came with (before any
 * stamp_jump). Random numbers come from seed, section, label and stamp (to the microsecond;
 * gps_rtk_flapping: its phase) alone, so that no other device or fault moves them. Frozen messages and gps_vibration
 * also depend on what came before. */
class FaultInjector {
 public:
  /** \param log_start_s  to which the times of the faults refer [s since the epoch] */
  FaultInjector(std::vector<Fault> faults, double log_start_s, std::uint64_t seed);

  /** Whether a fault may change a message of this label and stamp; if not, apply() passes it through. */
  [[nodiscard]] bool touches(const std::string& label, double stamp_s) const;

  /** The message as it is with the faults: none if it is lost, else that one, then a copy for each fault that
   * duplicates it. `arrival_s` is never before that given. Give the messages in order of arrival, and every
   * MotionSample, also where touches() is false: gps_vibration needs the car's lateral acceleration. */
  [[nodiscard]] std::vector<Delivery> apply(Delivery delivery);

 private:
  /** What gps_vibration knows of one receiver. */
  struct Drift {
    double stamp_s = 0;                              ///< of the newest message in the interval
    double lateral_mps2 = 0;                         ///< of the car, lagged
    Eigen::Vector3d left = Eigen::Vector3d::Zero();  ///< in the map; zero while it is not known
    Eigen::Vector3d error_m = Eigen::Vector3d::Zero();
    std::optional<Eigen::Vector3d> p_fix_m;  ///< newest fix
  };

  [[nodiscard]] bool acts(const Fault& fault, const std::string& label, double stamp_s) const;
  [[nodiscard]] Noise noise(const Fault& fault, const std::string& device, std::int64_t count) const;
  [[nodiscard]] Eigen::Vector3d drift_m(const Fault& fault, const Sample& sample, double stamp_s);
  void changeGps(const Fault& fault, Sample& sample, double stamp_s);
  void change(const Fault& fault, Delivery& delivery, double stamp_s);

  std::vector<Fault> x_faults;
  double x_log_start_s;
  std::uint64_t x_seed;
  std::optional<MotionSample> x_motion;                            ///< newest, without faults
  std::map<std::pair<std::string, std::string>, Drift> x_drifts;   ///< by section and label
  std::map<std::pair<std::string, std::string>, Sample> x_frozen;  ///< by section and device
};

}  // namespace raceloc
