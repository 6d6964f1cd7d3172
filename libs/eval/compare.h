/** \file
 * Two runs on one truth: is one better, or is it chance? */
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "eval/picture.h"
#include "eval/table.h"

namespace raceloc {

/** The directions that are compared, as columns of errorsCsv(). */
constexpr std::array<const char*, 5> kCompared = {"position_plane_m", "lateral_m", "longitudinal_m",
                                                  "height_m", "heading_deg"};

/** Errors of one run, of a file of raceloc-eval --csv. */
struct ErrorSeries {
  std::string path;
  std::vector<double> stamp_s, truth_x_m, truth_y_m;  ///< stamps increase
  std::array<std::vector<double>, kCompared.size()> errors;
};

/** \throws InputError as readCsv() does, and for stamps that do not increase. */
[[nodiscard]] ErrorSeries readErrors(const std::string& path);
/** Whether a file's first line is that of errorsCsv(). */
[[nodiscard]] bool isErrorsFile(const std::string& path);

struct CompareOptions {
  double block_s = 10;    ///< of the blocks, longer than errors remember, > 0
  int resamples = 10000;  ///< >= 100
  std::uint64_t seed = 1;
};

/** rmse of both in one direction, over the blocks. */
struct Difference {
  const char* column;     ///< of kCompared
  double a_rmse, b_rmse;  ///< each block weighs the same
  double correlation;     ///< of the blocks' differences from one block to the next
  /** Of a_rmse - b_rmse, with the probability that chance alone makes a difference as large; none for fewer than
   * kFewestBlocks blocks. */
  struct Significance {
    double low, high;  ///< 95 % interval
    double p;
  };
  std::optional<Significance> significance;
};

constexpr std::size_t kFewestBlocks = 8;

struct Comparison {
  std::string a_path, b_path;
  CompareOptions options;
  double first_s, last_s;               ///< the time that both have
  std::size_t blocks;                   ///< with poses of both
  double block_s;                       ///< as it came out: the time is cut evenly
  std::vector<Difference> differences;  ///< one for each of kCompared
  std::vector<std::string> warnings;
};

/** Errors of neighbouring poses are much the same, so poses are no independent samples: blocks of time are, when they are
 * longer than errors remember. The common time is cut into equal blocks; each gives a mean squared error of A and one of B.
 * Interval: blocks are drawn with replacement, A's and B's together (block bootstrap, percentiles 2.5 and 97.5).
 * p: in each block A and B change places by a coin (randomization test of paired samples, two-sided); p = (1 + number of
 * draws with a difference at least as large) / (1 + draws). Warns if the differences of neighbouring blocks correlate in
 * some direction, and if no truth could be checked.
 * \throws InputError if the runs have no time in common, or not one truth (to 5 cm; where B has poses at 10 Hz or more), or
 * for more than 2e9 blocks to be drawn.
 * Source: Carlstein, Ann. Statist. 1986 (non-overlapping blocks); Kunsch, Ann. Statist. 1989; Edgington and Onghena,
 * Randomization Tests, 2007. */
[[nodiscard]] Comparison compare(const ErrorSeries& a, const ErrorSeries& b, const CompareOptions& options);

[[nodiscard]] Table tableOf(const Comparison& comparison, const std::string& title);

/** Error in the plane of both over time. \param name  of the picture */
[[nodiscard]] Picture comparisonPicture(const ErrorSeries& a, const ErrorSeries& b, const std::string& name);

}  // namespace raceloc
