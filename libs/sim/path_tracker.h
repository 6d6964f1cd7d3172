/** \file
 * How to steer along a path: the simulated driver's own law, and a test and demo controller for paths from elsewhere. No
 * product. */
#pragma once

#include "sim/car_options.h"

namespace raceloc {

/** A path as it lies about the car, in the plane of the road: x along the car, y to its left. */
struct PathAhead {
  double offset_m;         ///< of the rear axle, to the left of the path
  double heading_rad;      ///< of the car ...
  double direction_rad;    ///< ... and of the path beside it, from one axis
  double curvature_per_m;  ///< of the path where the car is kReaction_s later, positive to the left
  double dip_per_m;        ///< there, out of the road: positive where it curves upward under the car
  double up_left;          ///< of the unit vector that points up: along the path's left ...
  double up_normal;        ///< ... and the road's normal
};

/** Between a command and the turn that it makes [s]. */
constexpr double kReaction_s = 0.1;

/** Angle of the road wheels, left positive [rad]. Not limited by what the car can do.
 * Source: Kapania and Gerdes, Vehicle System Dynamics 53 (2015): feed-forward of the path's curvature with the tyres'
 * slip in the steady turn, and feedback of the offset at a point ahead, seen along the course that the rear axle
 * settles at. */
[[nodiscard]] double wantedSteering(const PathAhead& path, double forward_mps, double yaw_rate_rps,
                                    const CarOptions& car, const DriverOptions& driver);

}  // namespace raceloc
