#include "sensors/message_reader.h"

#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationRawDAQ.h>

#include <utility>

#include "sensors/mrpt_stamp.h"
#include "sensors/rawlog_objects.h"
#include "sensors/sample_conversion.h"

namespace raceloc {

using mrpt::obs::CObservation;
using mrpt::obs::CObservationComment;
using mrpt::obs::CObservationOdometry;
using mrpt::obs::CObservationRawDAQ;

namespace {

/** The steering [rad] in an observation that may go before its speed. */
std::optional<double> steeringIn(const CObservation& observation) {
  const auto* daq = dynamic_cast<const CObservationRawDAQ*>(&observation);
  return daq && daq->AIN_double.size() == 2 ? std::optional(daq->AIN_double[1]) : std::nullopt;
}

bool isSpeedOf(const CObservation& steering, const CObservation& next) {
  const auto* wheel = dynamic_cast<const CObservationOdometry*>(&next);
  return wheel && wheel->hasVelocities && wheel->sensorLabel == steering.sensorLabel &&
         wheel->timestamp == steering.timestamp;
}

}  // namespace

MessageReader::MessageReader(const std::string& path, std::optional<GeodeticPoint> map_origin)
    : x_objects(std::make_unique<RawlogObjects>(path)), x_map_origin(map_origin), x_ahead(x_objects->next()) {
  const auto* comment = dynamic_cast<const CObservationComment*>(x_ahead.get());
  if (comment == nullptr) return;
  x_header = headerIn(*comment);
  if (!x_map_origin) x_map_origin = x_header.origin;
  x_ahead.reset();
}

MessageReader::~MessageReader() = default;

double MessageReader::progress() const { return x_objects->progress(); }

std::shared_ptr<CObservation> MessageReader::nextObservation() {
  if (x_ahead) return std::exchange(x_ahead, nullptr);
  auto observation = x_objects->next();
  while (std::dynamic_pointer_cast<CObservationComment>(observation)) observation = x_objects->next();
  return observation;
}

std::optional<LogMessage> MessageReader::next(const Wanted& wanted) {
  const auto first = nextObservation();
  if (!first) return std::nullopt;
  LogMessage message{fromMrptStamp(first->timestamp), "", "", std::nullopt, {first}};
  const auto steering_rad = steeringIn(*first);
  if (steering_rad) {
    x_ahead = nextObservation();
    if (x_ahead && isSpeedOf(*first, *x_ahead)) message.originals.push_back(std::exchange(x_ahead, nullptr));
  }

  const CObservation& last = *message.originals.back();
  const auto device = deviceOf(last);
  message.label = device.label;
  message.kind = device.kind;
  if (!x_map_origin) x_map_origin = positionIn(last);
  if (wanted && !wanted(message)) return message;
  auto sample = sampleIn(last, {x_map_origin, x_header.origin});
  if (!sample || !isSound(last, *sample)) return message;
  if (auto* motion = std::get_if<MotionSample>(&*sample)) motion->steering_rad = steering_rad;
  message.sample = std::move(sample);
  return message;
}

}  // namespace raceloc
