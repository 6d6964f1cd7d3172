/** \file
 * Observations as they happen: feeds on threads of their own, one bounded queue. */
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/bounded_queue.h"

namespace mrpt::obs {
class CObservation;
}

namespace raceloc {

using Arrival = std::shared_ptr<mrpt::obs::CObservation>;
using SteadyTime = std::chrono::steady_clock::time_point;

/** Something that delivers observations. */
struct Feed {
  std::string label;  ///< of the sensor that is missed when it falls silent; empty: none is counted on
  /** Appends what came since the last call; waits for some milliseconds at most.
   * \return when to be called again; none: nothing will come any more
   * \throws InputError if nobody can go on with it; anything else is a sensor's trouble, and it is called again. */
  std::function<std::optional<SteadyTime>(std::vector<Arrival>&)> poll;
};

/** How a sensor does, by its label. */
struct SensorHealth {
  std::size_t came = 0;
  SteadyTime last;      ///< when the newest came; at first, when all began
  std::string trouble;  ///< what its driver complained of since; empty: of nothing
};

/** Merges feeds in their order of arrival. The queue is bounded: when whoever takes from it is too slow, the oldest
 * scan that waits is dropped, without scans the oldest observation, and counted by its label. */
class LiveSource {
 public:
  /** \param most  observations that wait, >= 1 */
  LiveSource(std::vector<Feed> feeds, std::size_t most);
  ~LiveSource();
  LiveSource(const LiveSource&) = delete;
  LiveSource& operator=(const LiveSource&) = delete;

  /** The next one, for which it waits at most so long; null: none came, or none will (see isAtEnd()).
   * \throws InputError of a feed */
  [[nodiscard]] Arrival next(std::chrono::milliseconds longest);
  /** All feeds have ended, and all that came was taken. */
  [[nodiscard]] bool isAtEnd() const { return x_queue.isAtEnd(); }
  /** The feeds are not called any more; what has come can still be taken. */
  void stop();
  /** Of what samples can be made of, and of the feeds' own labels. */
  [[nodiscard]] std::map<std::string, SensorHealth> health() const;
  /** How many observations of each label were dropped. */
  [[nodiscard]] std::map<std::string, std::size_t> dropped() const;

 private:
  void run(const Feed& feed);
  void take(Arrival arrival);

  std::vector<Feed> x_feeds;
  BoundedQueue<Arrival> x_queue;
  mutable std::mutex x_mutex;  ///< of the next five
  std::condition_variable x_stop_asked;
  bool x_stopped = false;
  std::map<std::string, SensorHealth> x_health;
  std::map<std::string, std::size_t> x_dropped;
  std::exception_ptr x_error;
  std::atomic<std::size_t> x_running;
  std::vector<std::thread> x_threads;
};

}  // namespace raceloc
