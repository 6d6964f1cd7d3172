#include "cli/usage_log.h"

#include <algorithm>
#include <utility>

#include "core/statistics.h"

namespace raceloc {

namespace {

std::optional<double> growthOverSecondHalf_MiB(const std::vector<UsageSample>& samples) {
  const auto medianOf = [&](std::size_t from, std::size_t to) {
    std::vector<double> values_MiB;
    for (std::size_t i = from; i < to; ++i) values_MiB.push_back(samples[i].rss_MiB);
    return quantile(std::move(values_MiB), 0.5);
  };
  const std::size_t n = samples.size();
  if (n < 8) return std::nullopt;
  return 2 * (medianOf(3 * n / 4, n) - medianOf(n / 2, 3 * n / 4));
}

}  // namespace

std::optional<bool> ProcessUsage::isFlat() const {
  if (!rss_growth_MiB) return std::nullopt;
  return *rss_growth_MiB < std::max(1.0, 0.02 * peak_rss_MiB);
}

void UsageLog::add(double end_s, const TreeReading& now) {
  const double cpu_s = std::max(now.cpu_s, x_cpu_s);  // a child that ended may be between two parents
  const double cores = (cpu_s - x_cpu_s) / (end_s - x_end_s);
  x_max = std::max(x_max, cores);
  x_min = std::min(x_min, cores);
  x_peak_MiB = std::max(x_peak_MiB, now.rss_MiB);
  ++x_periods;
  x_cpu_s = cpu_s;
  x_end_s = end_s;
  x_cores += cores;
  x_rss_MiB = std::max(x_rss_MiB, now.rss_MiB);
  if (++x_merged < x_merge) return;
  x_samples.push_back({end_s, x_cores / static_cast<double>(x_merged), x_rss_MiB});
  x_merged = 0;
  x_cores = x_rss_MiB = 0;
  if (x_samples.size() == ProcessUsage::kMostSamples) halve();
}

void UsageLog::fill(ProcessUsage& usage) const {
  usage.periods = x_periods;
  usage.cores_max = x_periods > 1 ? x_max : usage.cores_mean;
  usage.cores_min = x_periods > 1 ? x_min : usage.cores_mean;
  usage.peak_rss_MiB = std::max(usage.peak_rss_MiB, x_peak_MiB);
  usage.rss_growth_MiB = growthOverSecondHalf_MiB(x_samples);
  usage.samples = x_samples;
}

void UsageLog::halve() {
  for (std::size_t i = 0; i + 1 < x_samples.size(); i += 2) {
    const UsageSample &a = x_samples[i], &b = x_samples[i + 1];
    x_samples[i / 2] = {b.end_s, (a.cores + b.cores) / 2, std::max(a.rss_MiB, b.rss_MiB)};
  }
  x_samples.resize(x_samples.size() / 2);
  x_merge *= 2;
}

}  // namespace raceloc
