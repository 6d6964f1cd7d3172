/** \file
 * A rawlog message by message, for programs that edit one. */
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/samples.h"
#include "sensors/log_header.h"

namespace mrpt::obs {
class CObservation;
}

namespace raceloc {

class RawlogObjects;

/** One message: what was in the file, and the sample it holds. */
struct LogMessage {
  double stamp_s;                ///< of the observation
  std::string label;             ///< as in DeviceSummary: that of an INS pose is without `_pose`
  std::string kind;              ///< as in DeviceSummary: `lidar`, `gps`, ..., `other`
  std::optional<Sample> sample;  ///< empty when not wanted, and when no sound sample can be made of it
  /** As read. Two for speed with steering: CObservationRawDAQ, then CObservationOdometry. */
  std::vector<std::shared_ptr<mrpt::obs::CObservation>> originals;
};

/** Which messages to decode, which is slow for LiDAR; it is shown them without their samples. An empty one: all. */
using Wanted = std::function<bool(const LogMessage&)>;

/** Streams the messages of a log in the order of the file, in constant memory. Nothing is sorted, and nothing
 * is left out but actions, the bounds of sensory frames (their observations come one by one), and comments
 * after the first object (a log keeps only one).
 *
 * A CObservationRawDAQ {speed, steering} and the CObservationOdometry right after it, of the same label and
 * stamp, as LogWriter writes them, are one message; a RawDAQ elsewhere is a message of its own.
 *
 * The map frame is that of `map_origin` when given, else of the header's origin, else of the first GGA with a fix. */
class MessageReader {
 public:
  /** \throws InputError if the file cannot be read, or not even its first object. */
  explicit MessageReader(const std::string& path, std::optional<GeodeticPoint> map_origin = {});
  ~MessageReader();
  MessageReader(const MessageReader&) = delete;
  MessageReader& operator=(const MessageReader&) = delete;

  [[nodiscard]] const LogHeader& header() const { return x_header; }  ///< empty when the log has none
  /** Of the map frame. Without an origin in the header, it is empty until next() has met a GGA. */
  [[nodiscard]] const std::optional<GeodeticPoint>& origin() const { return x_map_origin; }

  /** Empty at the end of the log. \throws InputError as summarizeRawlog() does. */
  [[nodiscard]] std::optional<LogMessage> next(const Wanted& wanted = {});
  [[nodiscard]] double progress() const;  ///< of the file, 0..1

 private:
  [[nodiscard]] std::shared_ptr<mrpt::obs::CObservation> nextObservation();

  std::unique_ptr<RawlogObjects> x_objects;
  LogHeader x_header;
  std::optional<GeodeticPoint> x_map_origin;
  std::shared_ptr<mrpt::obs::CObservation> x_ahead;  ///< read, but not given out yet
};

}  // namespace raceloc
