#include "sensors/log_playback.h"

#include <mrpt/obs/CObservationComment.h>

#include <algorithm>
#include <utility>

#include "sensors/mrpt_stamp.h"
#include "sensors/rawlog_objects.h"

namespace raceloc {

namespace {

Arrival nextButComments(RawlogObjects& objects) {
  Arrival next = objects.next();
  while (std::dynamic_pointer_cast<mrpt::obs::CObservationComment>(next)) next = objects.next();
  return next;
}

}  // namespace

LogPlayback::LogPlayback(const std::string& path, double first_s, double speed)
    : x_objects(std::make_shared<RawlogObjects>(path)),
      x_first_s(first_s),
      x_speed(speed),
      x_start(std::chrono::steady_clock::now()) {}

Feed LogPlayback::feed() const {
  struct State {
    std::shared_ptr<RawlogObjects> objects;
    Arrival ahead;
    SteadyTime due;
  };
  const auto state = std::make_shared<State>(State{x_objects, nullptr, x_start});
  const auto poll = [state, first_s = x_first_s, speed = x_speed,
                     start = x_start](std::vector<Arrival>& arrivals) -> std::optional<SteadyTime> {
    if (state->ahead) arrivals.push_back(std::exchange(state->ahead, nullptr));
    while ((state->ahead = nextButComments(*state->objects))) {
      if (state->ahead->timestamp != INVALID_TIMESTAMP) {
        const std::chrono::duration<double> after((fromMrptStamp(state->ahead->timestamp) - first_s) / speed);
        state->due = std::max(state->due, start + std::chrono::duration_cast<SteadyTime::duration>(after));
      }
      if (state->due > std::chrono::steady_clock::now()) return state->due;
      arrivals.push_back(std::exchange(state->ahead, nullptr));
    }
    return std::nullopt;
  };
  return {"", poll};
}

double LogPlayback::now_s() const {
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - x_start;
  return x_first_s + x_speed * elapsed.count();
}

}  // namespace raceloc
