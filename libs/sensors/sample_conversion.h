/** \file
 * What sample an observation of a rawlog holds: the decoding that all readers share. */
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/samples.h"

namespace mrpt::obs {
class CObservation;
}

namespace raceloc {

inline const std::string kPoseSuffix = "_pose";     ///< of the label of an INS pose
inline constexpr double kKnot_mps = 1852.0 / 3600;  ///< the unit of NMEA

/** Label and kind under which an observation is counted, as in DeviceSummary. */
struct Device {
  std::string label, kind;
};
[[nodiscard]] Device deviceOf(const mrpt::obs::CObservation& observation);

/** Position of a GGA with a fix; heights above sea level are lifted to the ellipsoid by the undulation it
 * states. Empty for any other observation. */
[[nodiscard]] std::optional<GeodeticPoint> positionIn(const mrpt::obs::CObservation& observation);

/** Direction of travel in the map frame [rad, 0 = east, counter-clockwise] against that at the antenna, whose
 * frame is `here` [deg, 0 = true north, clockwise, 0..360]. Of the turn between both frames, the part about
 * the vertical counts: the tilt changes a course by its square, below 1e-6 rad within 6 km. */
[[nodiscard]] double bearingOf(double course_rad, const Pose& T_map_here);
[[nodiscard]] double courseOf(double bearing_deg, const Pose& T_map_here);  ///< its inverse, within +-pi

/** Origins of the frames that samples come from and go to. */
struct MapFrames {
  std::optional<GeodeticPoint> map_origin;     ///< of the samples; there whenever the header's is
  std::optional<GeodeticPoint> header_origin;  ///< of the INS poses in the log
};

/** Without steering, which is in an observation of its own. Empty for what no sample can be made of: other
 * kinds, a GPS without a fix, an INS pose in a log without an origin.
 * \throws InputError as scanFromObservation() does. */
[[nodiscard]] std::optional<Sample> sampleIn(const mrpt::obs::CObservation& observation,
                                             const MapFrames& frames);

/** Speed and yaw rate as CObservationOdometry, and before it, if there is steering, CObservationRawDAQ {speed,
 * steering}. */
[[nodiscard]] std::vector<std::shared_ptr<mrpt::obs::CObservation>> toObservations(
    const MotionSample& motion);

/** Whether the observation has a stamp, and the sample made of it only finite values. */
[[nodiscard]] bool isSound(const mrpt::obs::CObservation& observation, const Sample& sample);

}  // namespace raceloc
