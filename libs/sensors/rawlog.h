/** \file
 * MRPT rawlogs, read and written as the samples of core/samples.h.
 *
 *  - Scan: see sensors/lidar_conversion.h;
 *  - GpsFix: CObservationGPS with GGA (position, height above the ellipsoid) and BESTPOS (sigmas);
 *    with a velocity, also RMC (speed, course clockwise from true north at the antenna, time and date). It is
 *    read from other logs too, when its validity is 'A' and it is finite;
 *  - InsPose: CObservationRobotPose, label + `_pose`, in the map frame of the header's origin;
 *  - ImuSample: CObservationIMU;
 *  - MotionSample: CObservationOdometry.velocityLocal; with steering, also CObservationRawDAQ {speed, steering}.
 *
 * The header: see sensors/log_header.h. */
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/options.h"
#include "core/output_file.h"
#include "core/samples.h"
#include "sensors/device_tally.h"
#include "sensors/log_header.h"
#include "sensors/sample_order.h"

namespace mrpt::io {
class CFileGZOutputStream;
}
namespace mrpt::obs {
class CObservation;
class CObservationRawDAQ;
}  // namespace mrpt::obs
namespace mrpt::serialization {
class CSerializable;
}

namespace raceloc {

class RawlogObjects;

/** Section [log]: which devices of a rawlog are used. Shell patterns, several separated by blanks. */
struct LogOptions {
  std::string lidar_labels = "*";
  std::string gps_labels = "*";
  std::string imu_labels = "*";
  std::string vehicle_labels = "*";
  double reorder_window_s = 0.5;
  void describe(OptionList& keys);
};

struct LogSummary {
  std::string path;
  std::vector<DeviceSummary> devices;   ///< observations that no sample can be made of are of kind `other`
  std::optional<GeodeticPoint> origin;  ///< of the header, else of the first valid GGA
  double first_s, last_s;               ///< of the observations that have a stamp; infinities if none has
  Eigen::AlignedBox3d fixes_earth_m;  ///< where all its GGA are, earth-centred and -fixed; empty without one
  std::vector<std::string> gps_labels;  ///< of the receivers in it and of those that its header names, sorted
};

/** Reads the log once, without decoding points.
 * \param progress  is told the share that is done, 0..1; ends it by throwing
 * \throws InputError if it cannot be read, holds no observation, is truncated or has an unknown class (says
 * after how many objects). */
[[nodiscard]] LogSummary summarizeRawlog(const std::string& path,
                                         const std::function<void(double)>& progress = {});

/** \param kind one of the kinds of DeviceSummary
 * \throws InputError "rawlog P: no LiDAR observation labelled L (LiDAR labels in it: a, b)" if `patterns`
 * match no label of this kind. */
void requireDevice(const LogSummary& summary, const std::string& kind, const std::string& patterns);

/** requireDevice() for the LiDARs, and for other kinds whose patterns are not `*`. An empty list wants no IMU. */
void requireDevices(const LogSummary& summary, const LogOptions& options);

/** Labels and patterns that match no device of their kind, in words; `*` alone asks for nothing. */
[[nodiscard]] std::vector<std::string> missingDevices(const LogSummary& summary, const LogOptions& options);

/** A device whose stamps all lie a minute or more before or after the LiDARs' has another clock (up-time since it was
 * switched on, say): none of its samples would meet a scan, or all scans would be late.
 * LiDARs on different clocks are not told apart.
 * \throws InputError naming the first such device of those that `options` let through. */
void requireOneClock(const LogSummary& summary, const LogOptions& options);

/** Gives the observations of a log or of sensors one by one, in the order in which they came; null at the end. */
using NextObservation = std::function<std::shared_ptr<mrpt::obs::CObservation>()>;

/** Streams the samples of a log in order of time; equal stamps keep the order of the file.
 *
 * Samples wait until one that is `reorder_window_s` younger has been read; see SampleOrder. One that comes later than
 * that, when a younger one has already gone out, is dropped and counted (or passed: see Late), and so is one without a stamp or with a value
 * that is not finite, and one whose stamp is far ahead of all others.
 *
 * The map frame is that of `map_origin` when given, else of the header's origin, else of the first GGA with a
 * fix (known only once next() has met it). INS poses are in the frame of the header's origin, and are skipped
 * in a log without one.
 *
 * A fix of quality 0 is skipped. One without BESTPOS sigmas, as in foreign logs, or with sigmas of 0, gets by its
 * quality a horizontal sigma per unit of HDOP (1 when the log has none) of: single or PPS 2.5 m, DGPS 0.8 m, RTK fixed
 * 0.02 m, RTK float 0.3 m, others 5 m; 1.5 times that vertically. These are usual figures of receivers' data
 * sheets, not of this one. */
class LogReader {
 public:
  /** \throws InputError if the file cannot be read. */
  LogReader(const std::string& path, const LogOptions& options, std::optional<GeodeticPoint> map_origin = {},
            Late late = Late::dropped);
  /** Of a log that is still being written: the same observations, read from its file later, give the same samples.
   * next() waits as long as `observations` does, and passes on what that throws. */
  LogReader(NextObservation observations, const LogOptions& options, const GeodeticPoint& map_origin,
            const LogHeader& header, Late late = Late::dropped);
  ~LogReader();
  LogReader(const LogReader&) = delete;
  LogReader& operator=(const LogReader&) = delete;

  /** Empty at the end of the log. \throws InputError as summarizeRawlog() does. */
  [[nodiscard]] std::optional<Sample> next();
  [[nodiscard]] std::optional<GeodeticPoint> origin() const { return x_map_origin; }  ///< of the map frame
  [[nodiscard]] double progress() const;  ///< of the file, 0..1; without a file 0
  [[nodiscard]] std::size_t droppedLate() const { return x_unsound + x_order.droppedLate(); }
  /** Samples whose stamps are ahead of all others', by label; see SampleOrder. */
  [[nodiscard]] const std::map<std::string, std::size_t>& leftOut() const { return x_order.leftOut(); }

 private:
  struct Steering {
    double stamp_s, steering_rad;
  };
  void take(const mrpt::obs::CObservation& observation);
  void joinSteering(const mrpt::obs::CObservationRawDAQ& daq);
  [[nodiscard]] bool isWanted(const mrpt::obs::CObservation& observation) const;

  LogOptions x_options;
  std::unique_ptr<RawlogObjects> x_file;  ///< null without a file
  NextObservation x_next;
  bool x_at_end = false;
  std::optional<GeodeticPoint> x_map_origin, x_header_origin;
  SampleOrder x_order;
  std::map<std::string, Steering> x_steering;  ///< the last of each label
  std::size_t x_unsound = 0;
};

/** Writes a rawlog that appears under its name with commit() only. */
class LogWriter {
 public:
  /** \param gzip_level 1 for files, 0 (no compression) for live recording
   * \throws InputError if the file cannot be written. */
  LogWriter(const std::string& path, const LogHeader& header, int gzip_level = 1);
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  /** Samples in the map frame of the header's origin, in the order in which they arrive; at one stamp an INS pose
   * goes before its fix. Of a GPS covariance the sigmas along east, north and up are kept: no message that survives a
   * rawlog holds the rest. \throws std::invalid_argument for a GPS fix or INS pose if the header has no
   * origin */
  void write(const Sample& sample);
  /** For output logs, where the estimate is the only odometry: RawDAQ {speed_mps, steering_rad (NaN:
   * unknown), yaw_rate_rps}. */
  void writeVehicleAsDaq(const MotionSample& sample);
  /** A pose that is no receiver's, such as `truth` or an estimate, in the map frame: CObservationRobotPose.
   * Readers take it for an InsPose if its label ends in `_pose`.
   * \param covariance of a right increment: rotation [rad], then translation [m] */
  void writePose(double stamp_s, const std::string& label, const Pose& T_map_body,
                 const Matrix6d& covariance = Matrix6d::Zero());
  void write(const mrpt::serialization::CSerializable& annotation);
  /** Writes out what is left, without the final name yet: nothing more may be written. \throws InputError if the disk
   * is full. */
  void finish();
  /** finish(), then the final name. \throws InputError if the disk is full or the file cannot be renamed. */
  void commit();

 private:
  [[nodiscard]] const GeodeticPoint& origin() const;
  void writeSample(const GpsFix& fix);
  void writeSample(const InsPose& pose);
  void writeSample(const ImuSample& imu);
  void writeSample(const MotionSample& motion);
  void writeSample(const Scan& scan);

  LogHeader x_header;
  OutputFile x_output;
  std::unique_ptr<mrpt::io::CFileGZOutputStream> x_file;
};

}  // namespace raceloc
