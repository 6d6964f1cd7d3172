/** \file
 * Other cars. */
#pragma once

#include <vector>

#include "sim/race_car.h"

namespace raceloc {

/** A box that a LiDAR sees. */
struct Box {
  Pose T_map_box;  ///< its centre
  Eigen::Vector3d half_m;
};

struct BoxHit {
  double range_m = 0;  ///< 0: none
  double cosine = 0;   ///< of the angle of incidence
};
/** The first of the boxes along a ray. \param direction_map of unit length */
[[nodiscard]] BoxHit firstHit(const std::vector<Box>& boxes, const Eigen::Vector3d& origin_map_m,
                              const Eigen::Vector3d& direction_map);

/** Cars that drive the same circuit a little slower, each beside the racing line, at a share of the speed
 * profile. Track, line and profile must outlive it. */
class Traffic {
 public:
  /** \param cars     of the size of `car`, spread over the lap ahead of the start line */
  Traffic(const Track& track, const RacingLine& line, const SpeedProfile& profile, const CarOptions& car,
          int cars, std::uint64_t seed);
  [[nodiscard]] bool empty() const { return x_drivers.empty(); }
  /** Body and wing of each car at a time since the start. */
  [[nodiscard]] std::vector<Box> at(double time_s) const;

 private:
  struct Driver {
    double start_s, pace, beside_m;
  };
  const Track& x_track;
  const RacingLine& x_line;
  const SpeedProfile& x_profile;
  CarOptions x_car;
  std::vector<Driver> x_drivers;
};

}  // namespace raceloc
