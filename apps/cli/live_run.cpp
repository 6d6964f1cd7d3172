#include "cli/live_run.h"

#include <mrpt/obs/CObservation.h>

#include <chrono>
#include <cstdio>
#include <map>
#include <optional>
#include <utility>

#include "cli/app.h"
#include "core/errors.h"
#include "eval/format.h"
#include "pipeline/output_json.h"
#include "sensors/black_box.h"
#include "sensors/log_playback.h"
#include "sensors/message_reader.h"
#include "sensors/sensor_drivers.h"

namespace raceloc {

namespace {

using Clock = std::chrono::steady_clock;

double secondsBetween(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

std::string stateText(const Integrity& integrity) {
  return nameOf(integrity.state) + (integrity.cause.empty() ? "" : " (" + integrity.cause + ")");
}

/** The line on stderr: what is going on, once a second. */
class StatusLine {
 public:
  explicit StatusLine(double silent_after_s) : x_silent_after_s(silent_after_s) {}

  void hear(const LocalizerOutput& output, double age_s) {
    ++x_outputs;
    x_age_s = age_s;
    x_state = stateText(output.integrity);
    if (!output.decision) return;
    x_verdicts.clear();
    for (const SourceVerdict& v : output.decision->decision.sources)
      x_verdicts += " " + v.source + (v.accepted ? "" : " REJECTED");
  }

  /** Prints when the last time was a second ago. */
  void show(const LiveSource& source, const LineStream* stream) {
    const auto now = Clock::now();
    const double since_s = secondsBetween(x_shown, now);
    if (since_s < 1) return;
    std::string line = format("%.1f", static_cast<double>(x_outputs) / since_s) + " outputs/s, " + x_state;
    if (!x_verdicts.empty()) line += "; sources" + x_verdicts;
    line += "; sensors" + sensors(source, now, since_s);
    if (x_age_s) line += "; age " + format("%.2f s", *x_age_s);
    const double cpu_s = cpuTime_s();
    line += "; CPU " + format("%.0f %%", 100 * (cpu_s - x_cpu_s) / since_s);
    for (const auto& [label, times] : source.dropped())
      line += "; DROPPED " + std::to_string(times) + " of " + label;
    if (stream && stream->lost() > 0) line += "; stream lost " + std::to_string(stream->lost());
    std::fprintf(stderr, "raceloc-live: %s\n", line.c_str());
    x_shown = now;
    x_cpu_s = cpu_s;
    x_outputs = 0;
  }

 private:
  std::string sensors(const LiveSource& source, Clock::time_point now, double since_s) {
    std::string text;
    for (const auto& [label, health] : source.health()) {
      const double silence_s = secondsBetween(health.last, now);
      std::size_t& before = x_came[label];
      if (health.came == before && silence_s > x_silent_after_s)
        text += " " + label + format(" SILENT for %.0f s", silence_s) +
                (health.trouble.empty() ? "" : " (" + health.trouble + ")");
      else
        text += " " + label + format(" %.1f Hz", static_cast<double>(health.came - before) / since_s);
      before = health.came;
    }
    return text.empty() ? " none yet" : text;
  }

  double x_silent_after_s;
  Clock::time_point x_shown = Clock::now();
  double x_cpu_s = cpuTime_s();
  std::size_t x_outputs = 0;
  std::optional<double> x_age_s;
  std::string x_state = stateText(Integrity{}), x_verdicts;
  std::map<std::string, std::size_t> x_came;
};

/** What a live run runs on. */
struct Supply {
  LogHeader header;
  std::vector<std::string> gps_labels;
  std::vector<Feed> feeds;
  std::function<double()> now_s;
};

Supply sensorsOf(const LiveArgs& args) {
  OpenSensors sensors = openSensors(args.sensors_path);
  return {withGpsLabels({originOf(args.map_path), ""}, sensors.gps_labels), sensors.gps_labels,
          std::move(sensors.feeds), [] {
            const auto now = std::chrono::system_clock::now().time_since_epoch();
            return std::chrono::duration<double>(now).count();
          }};
}

Supply logOf(const LiveArgs& args, const ReplayOptions& options) {
  const LogSummary summary = lookedThrough(
      [&](const auto& progress) { return requirePlayable(args.rawlog_path, options, progress); });
  const LogHeader header = MessageReader(args.rawlog_path).header();
  const LogPlayback playback(args.rawlog_path, summary.first_s, *args.speed);
  return {withGpsLabels(header, summary.gps_labels), summary.gps_labels, {playback.feed()}, [playback] {
            return playback.now_s();
          }};
}

}  // namespace

Listener streaming(LineStream* stream, const std::function<double()>& now_s) {
  if (stream == nullptr) return {};
  return [stream, now_s, number = std::size_t{0}](const LocalizerOutput& output) mutable {
    const auto age_s = now_s ? std::optional(now_s() - output.stamp_s) : std::nullopt;
    stream->send(outputJson(output, {++number, age_s}));
  };
}

ReplayReport runInCar(const LiveArgs& args, const ReplayOptions& options, LineStream* stream,
                      const Listener& write, std::vector<std::string>& kept) {
  const QuietDrivers quiet;
  Supply supply = args.sensors_path.empty() ? logOf(args, options) : sensorsOf(args);
  std::optional<BlackBox> box;
  if (!args.record_path.empty()) box.emplace(args.record_path, supply.header);
  LiveSource source(std::move(supply.feeds), static_cast<std::size_t>(options.live.queue_length));
  StatusLine status(options.live.silent_after_s);

  const auto next = [&]() -> Arrival {
    constexpr std::chrono::milliseconds kLongest(50);  // until a signal is seen
    for (;;) {
      if (stopSignal() != 0) source.stop();
      status.show(source, stream);
      const bool is_at_end = source.isAtEnd();
      if (auto arrival = source.next(kLongest)) {
        if (box) box->write(arrival);
        return arrival;
      }
      if (is_at_end) return nullptr;
    }
  };
  const Listener send = streaming(stream, supply.now_s);
  const auto listen = [&](const LocalizerOutput& output) {
    if (send) send(output);
    write(output);
    status.hear(output, supply.now_s() - output.stamp_s);
  };
  const auto keep = [&] {
    if (!box) return;
    box->commit();
    kept.push_back(args.record_path + " (" + std::to_string(box->written()) + " observations)");
  };
  std::optional<ReplayReport> report;
  try {
    report = localizeLive({supply.header, supply.gps_labels, next}, args.map_path, args.output_path, options,
                          listen);
  } catch (...) {
    keep();  // what came in is most wanted when something went wrong
    throw;
  }
  keep();
  if (!args.output_path.empty()) kept.push_back(args.output_path);
  for (const auto& [label, times] : source.dropped())
    report->faults[label + ": dropped, the localizer was too slow"] += times;
  return *std::move(report);
}

}  // namespace raceloc
