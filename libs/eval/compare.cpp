#include "eval/compare.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "core/errors.h"
#include "core/statistics.h"
#include "eval/csv_columns.h"

namespace raceloc {

namespace {

constexpr double kSameTruth_m = 0.05;
constexpr double kLongestChord_s = 0.11;  // 10 Hz; at 30 m/s^2 a chord over it is off the way by 0.045 m
constexpr double kMostWork = 2e9;         // blocks that are drawn: a minute
constexpr double kCorrelated = 0.3;

std::vector<std::string> columnsOfErrors() {
  std::vector<std::string> columns{"stamp_s", "truth_x_m", "truth_y_m"};
  columns.insert(columns.end(), kCompared.begin(), kCompared.end());
  return columns;
}

/** Mean squared errors of both runs in one block. */
struct BlockErrors {
  double a = 0, b = 0;
};
using Blocks = std::vector<BlockErrors>;

std::string spanText(const ErrorSeries& run) {
  return run.path + " " + format("%.3f .. %.3f s", run.stamp_s.front(), run.stamp_s.back());
}

/** The truth of B is looked up between its poses, at A's stamps. \return how many of A's poses could be checked */
std::size_t requireOneTruth(const ErrorSeries& a, const ErrorSeries& b) {
  std::size_t checked = 0;
  for (std::size_t i = 0, j = 1; i < a.stamp_s.size() && j < b.stamp_s.size();) {
    if (a.stamp_s[i] > b.stamp_s[j]) {
      ++j;
      continue;
    }
    const double step_s = b.stamp_s[j] - b.stamp_s[j - 1], since_s = a.stamp_s[i] - b.stamp_s[j - 1];
    if (since_s >= 0 && step_s <= kLongestChord_s) {
      const auto truth_m = [&](const std::vector<double>& of_b) {
        return of_b[j - 1] + since_s / step_s * (of_b[j] - of_b[j - 1]);
      };
      const double apart_m =
          std::hypot(a.truth_x_m[i] - truth_m(b.truth_x_m), a.truth_y_m[i] - truth_m(b.truth_y_m));
      if (apart_m > kSameTruth_m)
        throw InputError("errors " + a.path + " and " + b.path + ": their truths are " +
                         format("%.2f m apart at %.3f s", apart_m, a.stamp_s[i]) +
                         "; only runs on one truth can be compared");
      ++checked;
    }
    ++i;
  }
  return checked;
}

/** Sums the squares of one run into blocks: sum and count. */
std::vector<std::pair<double, double>> sumsOf(const ErrorSeries& run, std::size_t direction, double first_s,
                                              double block_s, std::size_t count) {
  std::vector<std::pair<double, double>> sums(count);
  for (std::size_t i = 0; i < run.stamp_s.size(); ++i) {
    const double place = (run.stamp_s[i] - first_s) / block_s;
    if (place < 0 || place > static_cast<double>(count)) continue;
    auto& [sum, n] = sums[std::min(static_cast<std::size_t>(place), count - 1)];
    sum += run.errors[direction][i] * run.errors[direction][i];
    ++n;
  }
  return sums;
}

Blocks blocksOf(const ErrorSeries& a, const ErrorSeries& b, std::size_t direction, const Comparison& c,
                std::size_t count) {
  const auto of_a = sumsOf(a, direction, c.first_s, c.block_s, count);
  const auto of_b = sumsOf(b, direction, c.first_s, c.block_s, count);
  Blocks blocks;
  for (std::size_t k = 0; k < count; ++k)
    if (of_a[k].second > 0 && of_b[k].second > 0)
      blocks.push_back({of_a[k].first / of_a[k].second, of_b[k].first / of_b[k].second});
  return blocks;
}

/** rmse of A less that of B, over blocks that `pick(k)` gives. */
template <class Pick>
double rmseDifference(std::size_t count, const Pick& pick) {
  double a = 0, b = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const BlockErrors block = pick(k);
    a += block.a;
    b += block.b;
  }
  const auto n = static_cast<double>(count);
  return std::sqrt(a / n) - std::sqrt(b / n);
}

Difference::Significance significanceOf(const Blocks& blocks, const CompareOptions& options) {
  const std::size_t n = blocks.size();
  std::mt19937_64 random(
      options.seed);  // its numbers are the same everywhere, those of std's distributions are not
  std::vector<double> resampled;
  resampled.reserve(static_cast<std::size_t>(options.resamples));
  for (int i = 0; i < options.resamples; ++i)
    resampled.push_back(rmseDifference(n, [&](std::size_t) { return blocks[random() % n]; }));

  const double found = std::abs(rmseDifference(n, [&](std::size_t k) { return blocks[k]; }));
  int as_large = 0;
  for (int i = 0; i < options.resamples; ++i) {
    const double by_chance = rmseDifference(n, [&](std::size_t k) {
      return random() % 2 == 0 ? blocks[k] : BlockErrors{blocks[k].b, blocks[k].a};
    });
    if (std::abs(by_chance) >= found * (1 - 1e-12)) ++as_large;  // equal but for the order of the sums
  }
  return {quantile(resampled, 0.025), quantile(resampled, 0.975),
          static_cast<double>(1 + as_large) / static_cast<double>(1 + options.resamples)};
}

/** Of each block's difference with the next one's. */
double neighbourCorrelation(const Blocks& blocks) {
  const auto n = static_cast<double>(blocks.size());
  double mean = 0, variance = 0, covariance = 0;
  for (const auto& block : blocks) mean += (block.a - block.b) / n;
  for (std::size_t k = 0; k < blocks.size(); ++k) {
    const double d = blocks[k].a - blocks[k].b - mean;
    variance += d * d;
    if (k > 0) covariance += d * (blocks[k - 1].a - blocks[k - 1].b - mean);
  }
  return variance > 0 ? covariance / variance : 0;
}

}  // namespace

ErrorSeries readErrors(const std::string& path) {
  CsvColumns table = readCsv("errors", path, columnsOfErrors());
  ErrorSeries run;
  run.path = path;
  run.stamp_s = std::move(table.numbers["stamp_s"]);
  run.truth_x_m = std::move(table.numbers["truth_x_m"]);
  run.truth_y_m = std::move(table.numbers["truth_y_m"]);
  for (std::size_t k = 0; k < kCompared.size(); ++k) run.errors[k] = std::move(table.numbers[kCompared[k]]);
  for (std::size_t i = 1; i < run.stamp_s.size(); ++i)
    if (!(run.stamp_s[i] > run.stamp_s[i - 1]))
      throw InputError("errors " + path + ", line " + std::to_string(i + 2) + ": stamps must increase");
  return run;
}

bool isErrorsFile(const std::string& path) { return hasCsvColumns(path, columnsOfErrors()); }

Comparison compare(const ErrorSeries& a, const ErrorSeries& b, const CompareOptions& options) {
  Comparison c{a.path, b.path, options, 0, 0, 0, 0, {}, {}};
  c.first_s = std::max(a.stamp_s.front(), b.stamp_s.front());
  c.last_s = std::min(a.stamp_s.back(), b.stamp_s.back());
  if (!(c.last_s > c.first_s))
    throw InputError("errors " + spanText(a) + " and " + spanText(b) +
                     ": no time in common; only runs on one truth can be compared");
  const bool is_checked = requireOneTruth(a, b) > 0;
  const double common_s = c.last_s - c.first_s;
  const auto count = static_cast<std::size_t>(std::clamp(std::floor(common_s / options.block_s), 1.0, 1e6));
  c.block_s = common_s / static_cast<double>(count);
  if (const double work = static_cast<double>(count) * options.resamples; work > kMostWork)
    throw InputError(
        "compare: " + std::to_string(count) + " blocks, drawn " + std::to_string(options.resamples) +
        " times, would take very long; take longer blocks (--block) or fewer draws (--resamples)");

  for (std::size_t k = 0; k < kCompared.size(); ++k) {
    const Blocks blocks = blocksOf(a, b, k, c, count);
    if (blocks.empty())
      throw InputError("errors " + a.path + " and " + b.path +
                       ": no block of time holds poses of both; take longer ones with --block");
    Difference d{kCompared[k], 0, 0, 0, std::nullopt};
    for (const auto& block : blocks) {
      d.a_rmse += block.a / static_cast<double>(blocks.size());
      d.b_rmse += block.b / static_cast<double>(blocks.size());
    }
    d.a_rmse = std::sqrt(d.a_rmse);
    d.b_rmse = std::sqrt(d.b_rmse);
    if (blocks.size() >= kFewestBlocks) d.significance = significanceOf(blocks, options);
    d.correlation = neighbourCorrelation(blocks);
    c.blocks = blocks.size();
    c.differences.push_back(d);
  }
  if (c.blocks < kFewestBlocks)
    c.warnings.push_back(
        format("%zu blocks of %.1f s are too few to tell a difference from chance: %zu are needed; drive "
               "longer, or take shorter ones (--block) if errors do not last that long",
               c.blocks, c.block_s, kFewestBlocks));
  else if (const Difference worst = *std::max_element(c.differences.begin(), c.differences.end(),
                                                      [](const Difference& one, const Difference& other) {
                                                        return one.correlation < other.correlation;
                                                      });
           worst.correlation > kCorrelated)
    c.warnings.push_back(
        format("the differences of neighbouring blocks correlate (%s: %.2f): its interval is too narrow "
               "and p too small; take longer blocks (--block)",
               worst.column, worst.correlation));
  if (!is_checked)
    c.warnings.emplace_back(
        "no pose of A lies between two of B that are near enough: whether both have one truth is not known");
  return c;
}

}  // namespace raceloc
