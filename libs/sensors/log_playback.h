/** \file
 * A recorded log as if it happened now. */
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "sensors/live_source.h"

namespace raceloc {

class RawlogObjects;

/** Hands out the observations of a log in the order of the file, each when the newest stamp so far is due. */
class LogPlayback {
 public:
  /** The log begins now. \param first_s  first stamp of the log; \param speed  of its time against ours, > 0
   * \throws InputError if the file cannot be read. */
  LogPlayback(const std::string& path, double first_s, double speed);
  /** To be used once. It keeps what it needs. */
  [[nodiscard]] Feed feed() const;
  /** The time that the log has now: what its stamps are compared with. */
  [[nodiscard]] double now_s() const;

 private:
  std::shared_ptr<RawlogObjects> x_objects;
  double x_first_s, x_speed;
  SteadyTime x_start;
};

}  // namespace raceloc
