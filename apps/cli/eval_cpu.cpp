#include "cli/eval_cpu.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/app.h"
#include "cli/command_text.h"
#include "cli/process_usage.h"
#include "cli/text_options.h"
#include "core/output_file.h"
#include "eval/format.h"
#include "eval/picture.h"

namespace raceloc {

namespace {

constexpr char kCpuManual[] = R"(NAME
  raceloc-eval cpu - what a command costs in CPU and memory

SYNOPSIS
  raceloc-eval cpu [--recorded S] [--period S] [--json FILE] [--picture FILE.svg|FILE.png] -- COMMAND [ARGUMENT ...]

DESCRIPTION
  Runs any command to its end, its input and output untouched, and asks the operating system once a period what it and
  the processes that it started have used. Says on stderr:
    CPU        mean over the run, maximum and minimum over the periods, in percent of all threads of this machine, as the
               paper's table has it (16 threads there), and in cores
    core-seconds, in all and, with --recorded, for a second of the log that the command plays
    wall time, peak resident memory, and whether memory was still growing in the second half of the run
  --json keeps these and the samples (1200 at most: of a long run, longer periods).
  Latencies stage by stage are the program's own to tell: raceloc-live prints scan to pose (median, p99, maximum), and
  writes all of them with --latency.

EXAMPLES
  raceloc-eval cpu --recorded 90 --json cpu.json -- raceloc-live -c ini/live.ini -m lor.rlmap -i race.rawlog
  raceloc-eval cpu -- kiss_icp_pipeline --dataloader kitti /data

EXIT STATUS
  that of the command, 128 + N if signal N ended it; 2 it cannot be started, or arguments are wrong; 1 an error of the
  program.
)";

double percent(double cores, long threads) { return 100 * cores / static_cast<double>(threads); }

void print(const CpuArgs& args, const ProcessUsage& u, long threads) {
  std::fprintf(stderr, "command          %s: exit status %d\n", args.command.front().c_str(), u.exit_status);
  std::fprintf(stderr, "wall             %.2f s\n", u.wall_s);
  std::fprintf(stderr,
               "CPU              mean %.2f, max %.2f, min %.2f %% of %ld threads (%zu periods of %g s)\n",
               percent(u.cores_mean, threads), percent(u.cores_max, threads), percent(u.cores_min, threads),
               threads, u.periods, args.period_s);
  std::fprintf(stderr, "cores            mean %.3f, max %.3f, min %.3f\n", u.cores_mean, u.cores_max,
               u.cores_min);
  std::fprintf(stderr, "core-seconds     %.2f (user %.2f, system %.2f)", u.cpu_s(), u.user_s, u.system_s);
  if (args.recorded_s)
    std::fprintf(stderr, "; %.4f a recorded second, %.1f s recorded", u.cpu_s() / *args.recorded_s,
                 *args.recorded_s);
  std::fprintf(stderr, "\nmemory           peak %.1f MiB; ", u.peak_rss_MiB);
  if (u.rss_growth_MiB)
    std::fprintf(stderr, "%+.1f MiB over the second half of the run: %s\n", *u.rss_growth_MiB,
                 *u.isFlat() ? "flat" : "GROWING");
  else
    std::fprintf(stderr, "too short to tell whether it grows\n");
}

std::string json(const CpuArgs& args, const ProcessUsage& u, long threads) {
  using nlohmann::ordered_json;
  const auto figures = [&](double scale) {
    return ordered_json{
        {"mean", scale * u.cores_mean}, {"max", scale * u.cores_max}, {"min", scale * u.cores_min}};
  };
  ordered_json json{{"command", args.command},
                    {"exit_status", u.exit_status},
                    {"wall_s", u.wall_s},
                    {"threads_of_machine", threads},
                    {"cpu_percent_of_machine", figures(percent(1, threads))},
                    {"cores", figures(1)},
                    {"core_s", u.cpu_s()},
                    {"user_s", u.user_s},
                    {"system_s", u.system_s}};
  if (args.recorded_s) {
    json["recorded_s"] = *args.recorded_s;
    json["core_s_per_recorded_s"] = u.cpu_s() / *args.recorded_s;
  }
  json["peak_rss_MiB"] = u.peak_rss_MiB;
  if (u.rss_growth_MiB) {
    json["rss_growth_second_half_MiB"] = *u.rss_growth_MiB;
    json["rss_is_flat"] = *u.isFlat();
  }
  json["period_s"] = args.period_s;
  json["periods"] = u.periods;
  json["samples"] = ordered_json::array();
  for (const auto& [end_s, cores, rss_MiB] : u.samples)
    json["samples"].push_back({{"end_s", end_s}, {"cores", cores}, {"rss_MiB", rss_MiB}});
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

Picture usagePicture(const ProcessUsage& u) {
  std::string script =
      "$usage << EOD\n0 " + number(u.samples.empty() ? 0 : u.samples.front().cores) + " NaN\n";
  for (const auto& [end_s, cores, rss_MiB] : u.samples)
    script += number(end_s) + " " + number(cores) + " " + number(rss_MiB) + "\n";
  script += "EOD\nset xrange [0:" + number(std::max(u.wall_s, 1e-3)) +
            "]\nset yrange [0:*]\nset y2range [0:*]\nset y2tics\nset xlabel 'time [s]'\nset ylabel 'cores'\n"
            "set y2label 'resident [MiB]'\nset key outside top left horizontal Left reverse samplen 2\n"
            "plot $usage using 1:2 with fsteps lw 1.5 lc rgb '" +
            std::string(kBlue) + "' title 'CPU', $usage using 1:3 axes x1y2 with lines lw 1.5 lc rgb '" +
            kVermillion + "' title 'memory'\n";
  return {"usage", "CPU and memory", 320, std::move(script)};
}

}  // namespace

std::optional<CpuArgs> parseCpuArgs(const std::vector<std::string>& words) {
  const auto dashes = std::find(words.begin(), words.end(), "--");
  std::vector<std::string> options{words.front()};
  options.insert(options.end(), words.begin() + 2, dashes);
  CommandLine cmd(kCpuManual);
  Text recorded("", "recorded", "length of the log that the command plays [s]", false, "", "S", cmd);
  Text period("", "period", "time between samples [s], default 0.5", false, "0.5", "S", cmd);
  Text json_path("", "json", "write the figures for other programs", false, "", "FILE", cmd);
  Text picture("", "picture", "write CPU and memory over time, SVG or PNG by the name", false, "",
               "FILE.svg|FILE.png", cmd);
  if (!cmd.parse(options)) return std::nullopt;

  CpuArgs args;
  if (dashes != words.end()) args.command.assign(dashes + 1, words.end());
  if (args.command.empty())
    throw InputError("cpu: no command given; write it after --, as in: cpu -- COMMAND ...");
  args.period_s = numberOf(period, between(0.01, 3600));
  if (recorded.isSet()) args.recorded_s = numberOf(recorded, above(0));
  args.json_path = json_path.getValue();
  args.picture_path = picture.getValue();
  if (!args.picture_path.empty()) (void)formatOf(args.picture_path);
  requireApart({}, {args.json_path, args.picture_path});
  return args;
}

int runCpu(const CpuArgs& args) {
  for (const std::string& path : {args.json_path, args.picture_path})
    if (!path.empty()) OutputFile{path};  // one that cannot be written is told before the work, not after
  const ProcessUsage usage = runMeasured(args.command, args.period_s);
  const long threads = sysconf(_SC_NPROCESSORS_ONLN);
  print(args, usage, threads);
  if (!args.json_path.empty()) writeTextFile(args.json_path, json(args, usage, threads));
  if (!args.picture_path.empty())
    writeTextFile(args.picture_path, drawn(usagePicture(usage), formatOf(args.picture_path)));
  return usage.exit_status;
}

}  // namespace raceloc
