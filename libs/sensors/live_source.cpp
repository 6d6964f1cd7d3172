#include "sensors/live_source.h"

#include <mrpt/obs/CObservation.h>

#include <utility>

#include "core/errors.h"
#include "sensors/mrpt_message.h"
#include "sensors/sample_conversion.h"

namespace raceloc {

LiveSource::LiveSource(std::vector<Feed> feeds, std::size_t most)
    : x_feeds(std::move(feeds)), x_queue(most), x_running(x_feeds.size()) {
  for (const Feed& feed : x_feeds)
    if (!feed.label.empty()) x_health[feed.label].last = std::chrono::steady_clock::now();
  if (x_feeds.empty()) x_queue.close();
  x_threads.reserve(x_feeds.size());
  for (const Feed& feed : x_feeds) x_threads.emplace_back([this, &feed] { run(feed); });
}

LiveSource::~LiveSource() {
  stop();
  for (auto& thread : x_threads) thread.join();
}

void LiveSource::stop() {
  const std::lock_guard lock(x_mutex);
  x_stopped = true;
  x_stop_asked.notify_all();
}

void LiveSource::run(const Feed& feed) {
  constexpr std::chrono::seconds kRetry(1);  // a driver in trouble is not asked more often
  std::vector<Arrival> arrivals;
  std::optional<SteadyTime> due = std::chrono::steady_clock::now();
  while (due) {
    {
      std::unique_lock lock(x_mutex);
      if (x_stop_asked.wait_until(lock, *due, [&] { return x_stopped; })) break;
    }
    arrivals.clear();
    try {
      due = feed.poll(arrivals);
    } catch (const InputError&) {
      const std::lock_guard lock(x_mutex);
      x_error = std::current_exception();
      due.reset();
    } catch (const std::exception& e) {
      const std::lock_guard lock(x_mutex);
      x_health[feed.label].trouble = mrptMessage(e.what());
      due = std::chrono::steady_clock::now() + kRetry;
    }
    for (Arrival& arrival : arrivals) take(std::move(arrival));
  }
  if (--x_running == 0) x_queue.close();
}

void LiveSource::take(Arrival arrival) {
  const auto device = deviceOf(*arrival);
  if (device.kind != "other") {
    const std::lock_guard lock(x_mutex);
    SensorHealth& health = x_health[device.label];
    ++health.came;
    health.last = std::chrono::steady_clock::now();
    health.trouble.clear();
  }
  const auto gone = x_queue.pushOver(
      std::move(arrival), [](const Arrival& waiting) { return deviceOf(*waiting).kind == "lidar"; });
  if (!gone) return;
  const std::lock_guard lock(x_mutex);
  ++x_dropped[(*gone)->sensorLabel];
}

Arrival LiveSource::next(std::chrono::milliseconds longest) {
  if (auto arrival = x_queue.popWithin(longest)) return std::move(*arrival);
  const std::lock_guard lock(x_mutex);
  if (x_error) std::rethrow_exception(x_error);
  return nullptr;
}

std::map<std::string, SensorHealth> LiveSource::health() const {
  const std::lock_guard lock(x_mutex);
  return x_health;
}

std::map<std::string, std::size_t> LiveSource::dropped() const {
  const std::lock_guard lock(x_mutex);
  return x_dropped;
}

}  // namespace raceloc
