/** \file
 * The rawlog that raceloc-live writes: what came in, and beside it what was made of it, in stock MRPT
 * classes. */
#pragma once

#include <string>
#include <vector>

#include "pipeline/localizer.h"
#include "sensors/rawlog.h"

namespace raceloc {

/** Samples go in as they came, but speed and steering as CObservationRawDAQ. Beside them, by label:
 *  - `estimate`, CObservationOdometry: the planar pose, the only odometry of the log;
 *  - `estimate_pose`, CObservationRobotPose: T_map_body with its 6x6 covariance;
 *  - `integrity`, CObservationRawDAQ, AIN_double: state (0 ok, 1 degraded, 2 dead reckoning, 3 lost), what was measured
 *    and its limit, protection levels lateral [m], longitudinal [m], heading [rad], alert limit [m];
 *  - `gate`, CObservationRawDAQ, AIN_double, at each decision: rule (1..4), alarm, then for each source five values:
 *    Delta, limit, p(Theta|x), weight, accepted; -1 where a source had no say. The order of sources is in the header;
 *  - `guard`, CObservationRawDAQ, AIN_double, at each sweep: state (0 localized, 1 wall following, 2 emergency, 3 no wall),
 *    wheel to wall [m], time to wall [s], then of the left and of the right wall distance [m], its sigma [m], heading
 *    [rad], length [m], age [s]; -1e9 for what there is none of;
 *  - (no label), CObservation3DScene at each sweep: car, scan, sources with 3-sigma ellipses, walls, the path along one,
 *    verdicts and guard as text. */
class AnnotatedLog {
 public:
  /** \param sources  labels that may appear in decisions, in the order of the columns
   * \throws InputError if the file cannot be written. */
  AnnotatedLog(const std::string& path, const GeodeticPoint& origin, std::vector<std::string> sources,
               int gzip_level);
  void write(const Sample& sample);
  void write(const LocalizerOutput& output);
  void commit() { x_writer.commit(); }

 private:
  std::vector<std::string> x_sources;
  LogWriter x_writer;
};

}  // namespace raceloc
