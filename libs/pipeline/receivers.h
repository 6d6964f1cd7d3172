/** \file
 * What GPS/INS receivers say of the car. */
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>

#include "core/samples.h"
#include "core/types.h"
#include "fusion/fusion_types.h"
#include "pipeline/localizer_options.h"

namespace raceloc {

/** What is known of the car's motion while a receiver speaks. */
struct CarMotion {
  std::optional<Eigen::Matrix3d> R_map_body;  ///< none before the start
  double yaw_rate_rps;                        ///< about the car's vertical
  double slip_rad;                            ///< from heading to course
};

/** Turns fixes of antennas into fixes of the car: lever arm, and a heading from the receiver's INS, or, of two fixes at
 * speed, the course. */
class Receivers {
 public:
  /** The newest fix with a heading: where to look for the car. */
  struct Place {
    double first_fix_s;  ///< stamp of the first fix with a heading, of any receiver: when waiting began
    double stamp_s;
    std::string receiver;
    Pose T_map_body;  ///< level, where there is no INS
    Eigen::Matrix2d cov_p_m2;
  };

  explicit Receivers(const LocalizerPolicy& policy)
      : x_gps_min_sigma_m(policy.gps_min_sigma_m),
        x_min_course_speed_mps(policy.min_course_speed_mps),
        x_course_sigma_deg(policy.course_sigma_deg) {}

  /** \param pose  with a finite pose and a covariance > 0 */
  void take(const InsPose& pose);
  /** A fix with a heading becomes the place(), too, unless it came late. A course is against the receiver's fix before.
   * \param fix  of finite values \param car  at about its time
   * \return none before the start, while there is no heading */
  [[nodiscard]] std::optional<PoseFix> take(const GpsFix& fix, const CarMotion& car);
  [[nodiscard]] const std::optional<Place>& place() const { return x_place; }

 private:
  struct Receiver {
    std::optional<GpsFix> previous;  ///< the one before: for the course
    std::optional<InsPose> ins;      ///< newest
  };
  struct Course {
    double course_rad, sigma_rad;
  };

  [[nodiscard]] std::optional<Course> courseOf(const GpsFix& fix, const GpsFix& previous,
                                               const CarMotion& car) const;
  void keepPlace(const GpsFix& fix, const PoseFix& of_car, const Receiver& receiver);

  std::optional<Place> x_place;
  std::map<std::string, Receiver> x_receivers;
  double x_gps_min_sigma_m, x_min_course_speed_mps, x_course_sigma_deg;
};

}  // namespace raceloc
