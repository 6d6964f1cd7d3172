/** \file
 * CPU and memory over a run, in bounded memory. */
#pragma once

#include <cmath>
#include <cstddef>
#include <optional>
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
  /** Of the largest process, or of all together when a sample saw more; at least what the measuring process held when it
   * started the command, some 7 MiB: Linux counts that in. */
  double peak_rss_MiB;
  /** Change over the second half of the run: twice that between the medians of its quarters, so that what a program frees
   * before it ends does not hide it; none for fewer than 8 samples. */
  std::optional<double> rss_growth_MiB;
  std::vector<UsageSample>
      samples;  ///< at most kMostSamples: of a long run, longer periods with the largest memory

  static constexpr std::size_t kMostSamples = 1200;
  [[nodiscard]] double cpu_s() const { return user_s + system_s; }  ///< core-seconds
  /** Grows over the second half by less than 1 MiB or 2 % of the peak; none if that is not known. */
  [[nodiscard]] std::optional<bool> isFlat() const;
};

/** What all processes of a command have used and hold at an instant. */
struct TreeReading {
  double cpu_s = 0, rss_MiB = 0;
};

/** Readings of a run as they come. */
class UsageLog {
 public:
  /** \param end_s  since the start, later than the one before */
  void add(double end_s, const TreeReading& now);
  /** All that readings tell, into what the end of the process told: wall_s, CPU and its mean, peak of one process. */
  void fill(ProcessUsage& usage) const;

 private:
  void halve();

  double x_cpu_s = 0, x_end_s = 0, x_max = 0, x_min = HUGE_VAL, x_peak_MiB = 0;
  std::size_t x_periods = 0;
  std::size_t x_merge = 1, x_merged = 0;  // periods a sample, and those in the one that grows
  double x_cores = 0, x_rss_MiB = 0;
  std::vector<UsageSample> x_samples;
};

}  // namespace raceloc
