/** \file
 * What a command costs, taken from the operating system. */
#pragma once

#include <string>
#include <vector>

namespace raceloc {

/** Of the command with all its children, over one period. */
struct UsageSample {
  double end_s;    ///< since the start
  double cores;    ///< CPU time over wall time
  double rss_MiB;  ///< resident at the end, the sum over the processes: what they share counts in each
};

struct ProcessUsage {
  int exit_status;                  ///< as a shell has it: 128 + N after signal N
  double wall_s, user_s, system_s;  ///< of the command and the children that it waited for
  double cores_mean;                ///< over the whole run
  double cores_max, cores_min;      ///< of whole periods; of a run shorter than two, the mean
  std::size_t periods;              ///< whole ones
  double peak_rss_MiB;              ///< of the largest process, or of all together when a sample saw more
  /** Change over the second half of the run: twice that between the medians of its quarters, so that what a program frees
   * before it ends does not hide it; 0 for fewer than 8 samples. */
  double rss_growth_MiB;
  std::vector<UsageSample>
      samples;  ///< at most kMostSamples: of a long run, longer periods with the largest memory

  static constexpr std::size_t kMostSamples = 1200;
  [[nodiscard]] double cpu_s() const { return user_s + system_s; }  ///< core-seconds
  /** Grows over the second half by less than 1 MiB or 2 % of the peak. */
  [[nodiscard]] bool isFlat() const;
};

/** Runs a command to its end, with the standard streams and the environment of this process, and looks at it and its
 * children once a period. Ctrl-C at the terminal is the command's own business; a SIGINT or SIGTERM that is sent to this
 * process is handed on.
 * \param command   the program, as a shell would find it, and its arguments; at least one word
 * \param period_s  > 0
 * \throws InputError if it cannot be started.
 * Source: proc(5), clock_getcpuclockid(3), wait4(2). */
[[nodiscard]] ProcessUsage runMeasured(const std::vector<std::string>& command, double period_s);

}  // namespace raceloc
