/** \file
 * How a LiDAR sweep sits in MRPT's classes. Nothing else in raceloc knows.
 *
 * A Scan is written as a CObservationPointCloud with a CColouredPointsMap, so that stock viewers open it:
 * R = intensity (0..1), G = ring / 255, B = seconds since the observation's stamp. -1 in all points of a
 * channel says that the scan does not have it. Coordinates are rounded to 1/512 m and times to 2^-17 s (0.6
 * mm at 80 m/s), so that gzip bites. */
#pragma once

#include <memory>
#include <optional>

#include "core/samples.h"

namespace mrpt::obs {
class CObservation;
class CObservationPointCloud;
}  // namespace mrpt::obs

namespace raceloc {

/** `time_s` may lie before 0 only by rounding. Points that are not finite are written as they are. */
[[nodiscard]] std::shared_ptr<mrpt::obs::CObservationPointCloud> toObservation(const Scan& scan);

/** The sweep in an observation of one of these kinds, empty for any other:
 *  - CObservationPointCloud with a CColouredPointsMap, taken for one of ours; with a CPointsMapXYZI
 * (intensity, no times); with any other point map (coordinates only);
 *  - CObservationVelodyneScan: with the stamp of each point and its laser; the scan's stamp is its first
 * point's. Points that are not finite are left out. \throws InputError for a cloud that is kept in a file of
 * its own (`rawlog-edit --de-externalize` brings it back). */
[[nodiscard]] std::optional<Scan> scanFromObservation(const mrpt::obs::CObservation& observation);

}  // namespace raceloc
