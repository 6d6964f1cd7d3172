#include "cloud/point_times.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <numeric>
#include <vector>

namespace raceloc {

namespace {

constexpr float kRounding_s = 0.001F, kLongest_s = 1;
constexpr double kLongestSweep_s = 0.5, kLongestPeriods = 1.5;
constexpr float kEqual_s = 1e-4F;
constexpr std::size_t kManyPoints = 100;  // fewer may well be of one column
constexpr double kOutOfOrder = 0.1;       // share of the points; of random times it is 0.45

/** How times go along the cloud, ring by ring. */
struct Order {
  double jump_back_share;  ///< by more than a twentieth of the sweep
  bool ascending;
};
Order orderOf(const Scan& scan, float sweep_s) {
  constexpr float kJump = 0.05F;
  constexpr int kRings = 256;
  std::array<float, kRings> last_s;
  last_s.fill(-std::numeric_limits<float>::infinity());
  const bool rings = scan.ring.size() == scan.time_s.size();
  std::size_t jumps = 0, up = 0, down = 0;
  for (std::size_t i = 0; i < scan.time_s.size(); ++i) {
    const float ring = rings ? scan.ring[i] : 0;
    float& before_s = last_s[ring >= 0 && ring < kRings ? static_cast<std::size_t>(ring) : 0];
    const float time_s = scan.time_s[i];
    jumps += time_s < before_s - kJump * sweep_s ? 1 : 0;
    up += time_s > before_s ? 1 : 0;
    down += time_s < before_s ? 1 : 0;
    before_s = time_s;
  }
  return {static_cast<double>(jumps) / static_cast<double>(scan.time_s.size()), up >= down};
}

/** Share of the points whose time is not about that of the points around them in azimuth. */
double shareOffAzimuth(const Scan& scan, float sweep_s) {
  constexpr std::size_t kSectors = 64;
  constexpr float kAbout = 0.1F;
  std::vector<std::uint32_t> order(scan.time_s.size());
  std::iota(order.begin(), order.end(), 0U);
  std::vector<float> azimuth_rad(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    if (const float a = std::atan2(scan.cloud.y[i], scan.cloud.x[i]); std::isfinite(a)) azimuth_rad[i] = a;
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return azimuth_rad[a] < azimuth_rad[b]; });
  std::size_t off = 0;
  std::vector<float> times_s;
  for (std::size_t sector = 0; sector < kSectors; ++sector) {
    times_s.clear();
    for (std::size_t i = sector * order.size() / kSectors; i < (sector + 1) * order.size() / kSectors; ++i)
      times_s.push_back(scan.time_s[order[i]]);
    if (times_s.empty()) continue;
    const auto middle = times_s.begin() + static_cast<std::ptrdiff_t>(times_s.size() / 2);
    std::nth_element(times_s.begin(), middle, times_s.end());
    const float median_s = *middle;
    off += static_cast<std::size_t>(std::count_if(
        times_s.begin(), times_s.end(), [&](float t) { return std::abs(t - median_s) > kAbout * sweep_s; }));
  }
  return static_cast<double>(off) / static_cast<double>(order.size());
}

template <class... Values>
std::string text(const char* format, Values... values) {
  char line[120];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

}  // namespace

PointTimesVerdict checkPointTimes(const Scan& scan, std::optional<double> period_s,
                                  std::optional<bool> ascending) {
  const auto& times_s = scan.time_s;
  if (times_s.empty()) return {PointTimes::absent, "no point times"};
  if (times_s.size() != scan.cloud.size())
    return {PointTimes::not_seconds,
            text("%zu point times for %zu points", times_s.size(), scan.cloud.size())};
  if (!std::all_of(times_s.begin(), times_s.end(), [](float t) { return std::isfinite(t); }))
    return {PointTimes::not_seconds, "point times are not all numbers"};
  const auto [first, last] = std::minmax_element(times_s.begin(), times_s.end());
  const float sweep_s = *last - *first;
  if (*first < -kRounding_s || *last > kLongest_s)
    return {PointTimes::not_seconds, text("point times run from %.4g to %.4g s", *first, *last)};
  if (sweep_s > kLongestSweep_s || (period_s && sweep_s > kLongestPeriods * *period_s))
    return {PointTimes::too_long,
            text("point times run from %.4g to %.4g s, longer than a sweep", *first, *last)};
  if (times_s.size() <= kManyPoints) return {PointTimes::good, ""};
  if (sweep_s <= kEqual_s) return {PointTimes::all_equal, text("point times are all %.4g s", *first)};
  const Order order = orderOf(scan, sweep_s);
  if (order.jump_back_share > kOutOfOrder) {
    if (shareOffAzimuth(scan, sweep_s) > kOutOfOrder)
      return {PointTimes::unordered, "point times in no order"};
    return {PointTimes::good, ""};
  }
  if (ascending && *ascending != order.ascending) return {PointTimes::backwards, "point times run backwards"};
  return {PointTimes::good, "", order.ascending};
}

}  // namespace raceloc
