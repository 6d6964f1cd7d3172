#include "cli/inject.h"

#include <mrpt/obs/CObservation.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <variant>

#include "cli/app.h"
#include "core/output_file.h"
#include "sensors/message_reader.h"
#include "sensors/rawlog.h"
#include "sim/arrival_queue.h"
#include "sim/faults.h"

namespace raceloc {

namespace {

/** What was injected, as ini text for the header. Sections are numbered, so that a log may be injected into twice. */
std::string injectionText(const InjectArgs& args, std::vector<Fault> faults, const std::string& header_text) {
  int number = 1;
  const auto section = [&] { return "injection_" + std::to_string(number); };
  while (header_text.find("[" + section() + "]") != std::string::npos) ++number;
  for (auto& fault : faults) fault.section = section() + "_" + fault.section;
  const auto name = [](const std::string& path) { return std::filesystem::path(path).filename().string(); };
  return "\n[" + section() + "]\nversion = " + toolVersion() + "\nlog = " + name(args.input_path) +
         "\nfaults = " + name(args.faults_path) + "\nseed = " + std::to_string(args.seed) + "\n\n" +
         iniText(faults);
}

/** The copy: messages as they were read, and those that a fault changed, in order of arrival. */
class FaultyLog {
 public:
  FaultyLog(const std::string& path, const LogHeader& header, int gzip_level)
      : x_writer(path, header, gzip_level) {}
  using Originals = std::vector<std::shared_ptr<mrpt::obs::CObservation>>;
  void put(double arrival_s, std::variant<Originals, Sample> message) {
    x_late.push(arrival_s, std::move(message));
  }
  void writeUntil(double time_s) {
    constexpr std::size_t kMaxWaiting = 20'000;  // bounds the memory when a stamp far ahead stops the clock
    if (x_late.size() > kMaxWaiting) time_s = std::numeric_limits<double>::infinity();
    while (const auto arrived = x_late.pop(time_s)) {
      if (const auto* sample = std::get_if<Sample>(&arrived->second))
        x_writer.write(*sample);
      else
        for (const auto& original : std::get<Originals>(arrived->second)) x_writer.write(*original);
    }
  }
  void commit() {
    writeUntil(std::numeric_limits<double>::infinity());
    x_writer.commit();
  }

 private:
  LogWriter x_writer;
  ArrivalQueue<std::variant<Originals, Sample>> x_late;
};

}  // namespace

void inject(const InjectArgs& args) {
  const auto faults = readFaults(args.faults_path);
  const OutputFile probe(args.output_path);  // an output that cannot be written is told before the work
  const LogSummary summary =
      lookedThrough([&](const auto& progress) { return summarizeRawlog(args.input_path, progress); });
  std::vector<DeviceName> devices;
  for (const auto& device : summary.devices)
    if (device.kind != "other" && device.kind != "ins_pose") devices.push_back({device.label, device.kind});
  requireDevices(faults, args.faults_path, devices);
  if (!(summary.first_s <= summary.last_s))
    throw InputError("rawlog " + args.input_path + ": no observation has a stamp, so faults have no time");

  MessageReader reader(args.input_path, summary.origin);
  LogHeader header = reader.header();
  // In a log without an origin nobody knows the frame of INS poses; with one in the copy they would seem to be in it.
  const bool drops_poses = !header.origin && summary.origin;
  header.origin = summary.origin;
  header.text += injectionText(args, faults, header.text);
  FaultyLog log(args.output_path, header, args.gzip_level);
  FaultInjector injector(faults, summary.first_s, args.seed);

  std::size_t messages = 0, touched = 0, lost = 0, dropped_poses = 0;
  {
    Progress progress("injecting");
    double now_s = summary.first_s;  // of the recorder: the file is in its order
    const auto wanted = [&](const LogMessage& message) {
      return message.kind == "vehicle" || injector.touches(message.label, message.stamp_s);
    };
    while (auto message = reader.next(wanted)) {
      progress(reader.progress());
      if (drops_poses && message->kind == "ins_pose") {
        ++dropped_poses;
        continue;
      }
      ++messages;
      now_s = std::max(now_s, message->stamp_s);
      if (message->sample && injector.touches(message->label, message->stamp_s)) {
        const auto deliveries = injector.apply({now_s, std::move(*message->sample)});
        ++touched;
        if (deliveries.empty()) ++lost;
        for (const auto& delivery : deliveries) log.put(delivery.arrival_s, delivery.sample);
      } else {
        // A motion that stays as it is still tells the faults how the car moves.
        if (message->sample) (void)injector.apply({now_s, std::move(*message->sample)});
        log.put(now_s, std::move(message->originals));
      }
      log.writeUntil(now_s);
    }
  }
  log.commit();
  std::printf("messages         %zu, of which %zu within a fault, %zu of these lost\n", messages, touched,
              lost);
  if (touched == 0)
    std::printf("NO EFFECT        no message lies within a fault: the log lasts %.1f s\n",
                summary.last_s - summary.first_s);
  if (dropped_poses > 0)
    std::printf("DROPPED          %zu INS poses: the log has no origin, so their frame is unknown\n",
                dropped_poses);
  std::printf("written          %s\n", args.output_path.c_str());
}

}  // namespace raceloc
