#include "graph/gps_spans.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "core/statistics.h"

namespace raceloc {

namespace {

struct Judged {
  std::size_t key;
  double stamp_s, off_m, claimed_m;
  bool off, poor;
};

double worstSigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance).eigenvalues()(2));
}

std::map<std::string, std::vector<Judged>> judged(const std::vector<Keyframe>& keyframes,
                                                  const std::vector<Pose>& T_map_body,
                                                  const GraphOptions& o) {
  std::map<std::string, std::vector<Judged>> by_receiver;
  for (std::size_t key = 0; key < keyframes.size(); ++key)
    for (const KeyGps& gps : keyframes[key].gps) {
      const double off_m = (T_map_body[key] * gps.p_body_antenna_m - gps.p_map_antenna_m).norm();
      const double claimed_m = worstSigma(gps.cov_map_m2);
      by_receiver[gps.receiver].push_back(
          {key, keyframes[key].stamp_s, off_m, claimed_m,
           off_m > o.gps_refuse_sigma * worstSigma(flooredFix(gps.cov_map_m2, o)),
           claimed_m > o.gps_poor_sigma_m});
    }
  return by_receiver;
}

/** Whether another drive begins after key pose `a`, up to `b`. */
bool parted(const std::vector<Keyframe>& keyframes, std::size_t a, std::size_t b) {
  for (std::size_t key = a + 1; key <= b; ++key)
    if (beginsDrive(keyframes[key])) return true;
  return false;
}

/** Spans of the fixes for which `bad` holds. */
template <class Bad>
void collect(const std::string& receiver, const std::vector<Judged>& fixes,
             const std::vector<Keyframe>& keyframes, const GraphOptions& o, bool refused, const Bad& bad,
             std::vector<GpsSpan>& spans) {
  for (std::size_t begin = 0; begin < fixes.size();) {
    if (!bad(fixes[begin])) {
      ++begin;
      continue;
    }
    std::size_t end = begin + 1;  // one beyond the last bad fix
    for (std::size_t i = end; i < fixes.size() && !parted(keyframes, fixes[i - 1].key, fixes[i].key) &&
                              fixes[i].stamp_s - fixes[end - 1].stamp_s <= o.gps_span_gap_s;
         ++i)
      if (bad(fixes[i])) end = i + 1;
    std::vector<double> claimed_m;
    double squared_m2 = 0;
    for (std::size_t i = begin; i < end; ++i) {
      claimed_m.push_back(fixes[i].claimed_m);
      squared_m2 += fixes[i].off_m * fixes[i].off_m;
    }
    spans.push_back({receiver, fixes[begin].key, fixes[end - 1].key, fixes[begin].stamp_s,
                     fixes[end - 1].stamp_s, end - begin,
                     std::sqrt(squared_m2 / static_cast<double>(end - begin)), quantile(claimed_m, 0.5),
                     refused});
    begin = end;
  }
}

/** A fix as part of a chain. */
struct Link {
  std::size_t key;
  KeyGps* gps;
  Eigen::Vector3d offset_m;  ///< of the fix from where odometry leads its antenna
  double sigma_m;
  std::size_t length = 1;  ///< of the longest chain that ends here
  std::size_t before = 0;  ///< the link before in it; itself: none
};

/** Of the links first .. last - 1, refuses all that are not in the longest chain. */
void keepLongest(std::vector<Link>& links, std::size_t first, std::size_t last) {
  std::size_t at = first;
  for (std::size_t i = first; i < last; ++i) {
    links[i].gps->refused = true;
    if (links[i].length > links[at].length) at = i;
  }
  for (bool more = first < last; more; at = links[at].before) {
    links[at].gps->refused = false;
    more = links[at].before != at;
  }
}

}  // namespace

std::vector<GpsSpan> gpsSpans(const std::vector<Keyframe>& keyframes, const std::vector<Pose>& T_map_body,
                              const GraphOptions& options) {
  std::vector<GpsSpan> spans;
  for (const auto& [receiver, fixes] : judged(keyframes, T_map_body, options)) {
    const std::size_t first = spans.size();
    collect(
        receiver, fixes, keyframes, options, true, [](const Judged& f) { return f.off; }, spans);
    collect(
        receiver, fixes, keyframes, options, false, [](const Judged& f) { return f.poor && !f.off; }, spans);
    std::sort(spans.begin() + static_cast<std::ptrdiff_t>(first), spans.end(),
              [](const GpsSpan& a, const GpsSpan& b) {
                return std::make_pair(a.first, !a.refused) < std::make_pair(b.first, !b.refused);
              });
  }
  return spans;
}

void refuseUnchained(std::vector<Keyframe>& keyframes, const std::vector<Pose>& T_map_body,
                     const GraphOptions& o) {
  // Where the LiDAR odometry leads, in the map's axes: its steps, turned by attitudes that do not drift.
  std::vector<Eigen::Vector3d> led_m(keyframes.size(), Eigen::Vector3d::Zero());
  std::vector<double> path_m(keyframes.size(), 0);
  for (std::size_t key = 1; key < keyframes.size(); ++key) {
    const Eigen::Vector3d step_m = keyframes[key].since_last.T_start_end.translation();
    led_m[key] = led_m[key - 1] + T_map_body[key - 1].linear() * step_m;
    path_m[key] = path_m[key - 1] + step_m.norm();
  }
  std::map<std::string, std::vector<Link>> receivers;
  for (std::size_t key = 0; key < keyframes.size(); ++key)
    for (KeyGps& gps : keyframes[key].gps) {
      const Eigen::Vector3d antenna_m = led_m[key] + T_map_body[key].linear() * gps.p_body_antenna_m;
      receivers[gps.receiver].push_back(
          {key, &gps, gps.p_map_antenna_m - antenna_m, worstSigma(flooredFix(gps.cov_map_m2, o))});
    }
  for (auto& [receiver, links] : receivers) {
    std::size_t drive = 0;  // the first link of this drive
    for (std::size_t begin = 0, j = 0; j <= links.size(); ++j) {
      const bool ends = j == links.size();
      if (ends || (j > 0 && parted(keyframes, links[j - 1].key, links[j].key))) {
        keepLongest(links, drive, j);
        drive = begin = j;
        if (ends) break;
      }
      links[j].before = j;
      while (keyframes[links[j].key].stamp_s - keyframes[links[begin].key].stamp_s > o.gps_chain_reach_s)
        ++begin;
      for (std::size_t i = j; i-- > begin;) {
        if (links[i].length + 1 <= links[j].length) continue;
        const double away_m = (links[j].offset_m - links[i].offset_m).norm();
        const double may_m = 4 * std::hypot(links[i].sigma_m, links[j].sigma_m) +
                             o.gps_chain_share * (path_m[links[j].key] - path_m[links[i].key]) + 0.05;
        if (away_m > may_m) continue;
        links[j].length = links[i].length + 1;
        links[j].before = i;
      }
    }
  }
}

void refuse(std::vector<Keyframe>& keyframes, const std::vector<GpsSpan>& spans) {
  for (auto& k : keyframes)
    for (auto& gps : k.gps) gps.refused = false;
  for (const GpsSpan& span : spans)
    for (std::size_t key = span.first; span.refused && key <= span.last; ++key)
      for (auto& gps : keyframes[key].gps)
        if (gps.receiver == span.receiver) gps.refused = true;
}

std::string text(const GpsSpan& span, double zero_s) {
  char line[256];
  std::snprintf(line, sizeof line, "%s, %.1f .. %.1f s: %s %.2f m (%zu fixes), claims %.2f m",
                span.receiver.c_str(), span.begin_s - zero_s, span.end_s - zero_s,
                span.refused ? "off by" : "poor, off by", span.off_m, span.fixes, span.claimed_m);
  return line;
}

}  // namespace raceloc
