#include "fusion/reliability.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/types.h"
#include "fusion/chi_square.h"
#include "fusion/measurement.h"

namespace raceloc {

namespace {

// Of a step, whose share beyond x is exp(-x): that is no noise, the source is elsewhere now.
constexpr double kJump = 12;
// An estimate does not run away faster, not even backwards: what does is noise.
constexpr double kFastest_mps = 150;
constexpr double kMostNis = 1e6;
// What is older is no vote: since then, others have corrected the estimate. A LiDAR turns ten times a second.
constexpr double kVoice_s = 0.15;
// Where dead reckoning drifts, means are off by its rate times window_s, all alike after two windows.
constexpr double kSteady_windows = 2;

Eigen::Vector2d residualOf(const CarState& predicted, const PoseFix& fix) {
  return (readingOf(fix) - predictedReading(fix, predicted.mean)).head<2>();
}

/** Whoever may vouch for a position: a source, or the car's own motion. */
struct Witness {
  Eigen::Vector2d mean_m;
  Eigen::Matrix2d cov_m2;
};

/** Normalised by what both claim. */
double squaredDistance(const Witness& a, const Witness& b) {
  return squaredMahalanobis(a.mean_m - b.mean_m, a.cov_m2 + b.cov_m2);
}

int sizeOf(unsigned set) { return __builtin_popcount(set); }

/** How far a source is from the others, and how far would do. */
struct Separation {
  double by_m, limit_m;
};

/** The distance of a source from the nearest of the voters, if two of these agree with each other and none with it. */
std::optional<Separation> outvoted(const Witness& source, const std::vector<Witness>& voters, double limit) {
  const auto agrees = [&](const Witness& a, const Witness& b) { return squaredDistance(a, b) <= limit; };
  bool two_agree = false;
  double nearest = HUGE_VAL, nearest_m = HUGE_VAL;
  for (auto one = voters.begin(); one != voters.end(); ++one) {
    two_agree =
        two_agree || std::any_of(voters.begin(), one, [&](const Witness& w) { return agrees(w, *one); });
    const double distance = squaredDistance(source, *one);
    if (distance < nearest) {
      nearest = distance;
      nearest_m = (source.mean_m - one->mean_m).norm();
    }
  }
  if (!two_agree || nearest <= limit) return std::nullopt;
  return Separation{nearest_m, nearest_m * std::sqrt(limit / nearest)};
}

}  // namespace

void ReliabilityOptions::describe(OptionList& keys) {
  keys.add("window_s", window_s, above(0), "residuals of a source are averaged over this time [s]");
  keys.add("separation_m", separation_m, above(0),
           "sources whose mean residuals are farther apart disagree [m] ...");
  keys.add("separation_sigmas", separation_sigmas, above(0),
           "... unless they claim no better than this many sigmas");
  keys.add("confirm_false_alarm", confirm_false_alarm, between(1e-12, 0.1),
           "share of sound fixes that do not confirm a sound estimate, or that are outvoted");
  keys.add("inflate_from", inflate_from, atLeast(1),
           "how many times its claim a source's scatter or contradiction must be before its covariance is "
           "inflated by it");
  keys.add("fresh_s", fresh_s, above(0), "a source without a fix for this long is missing [s]");
  keys.add("return_s", return_s, atLeast(0),
           "a source that left is believed after it has agreed for this long [s]");
  keys.add("motion_memory_s", motion_memory_s, above(0),
           "the car's own motion remembers where the estimate was for this long [s]");
}

double positionNis(const CarState& predicted, const PoseFix& fix) {
  const Eigen::Matrix<double, 2, 4> H = observationMatrix(fix, predicted.mean(2)).topRows<2>();
  const Eigen::Matrix2d S = H * predicted.covariance * H.transpose() + fix.cov_p_m2;
  return std::min(squaredMahalanobis(residualOf(predicted, fix), S), kMostNis);
}

SourceRecord firstRecord(double stamp_s, const CarState& predicted, const PoseFix& fix) {
  SourceRecord first{};
  first.source = fix.source;
  first.stamp_s = stamp_s;
  first.residual_m = first.own_residual_m = first.mean_m = residualOf(predicted, fix);
  first.steady_since_s = stamp_s;
  first.rate_mps = Eigen::Vector2d::Zero();
  first.cov_m2 = fix.cov_p_m2;
  first.nis = positionNis(predicted, fix);
  if (fix.heading != HeadingKind::none) {
    first.heading_rad = innovation(readingOf(fix), predictedReading(fix, predicted.mean))(2);
    const double own_rad = fix.heading_rad - (fix.heading == HeadingKind::course ? predicted.mean(3) : 0.0);
    first.own_residual_m +=
        Eigen::Rotation2Dd(predicted.mean(2)) * fix.p_body_m - Eigen::Rotation2Dd(own_rad) * fix.p_body_m;
    if (fix.heading == HeadingKind::course) *first.heading_rad += predicted.mean(3);
    first.heading_sigma_rad = fix.heading_sigma_rad;
  }
  return first;
}

void record(SourceRecord& known, double stamp_s, const CarState& predicted, const PoseFix& fix,
            const ReliabilityOptions& options) {
  SourceRecord now = firstRecord(stamp_s, predicted, fix);
  now.left = known.left;
  now.left_by_m = known.left_by_m;
  now.left_limit_m = known.left_limit_m;
  now.leapt = known.leapt;
  now.supported = known.supported;
  if (stamp_s - known.stamp_s <= options.fresh_s) {
    const double share = -std::expm1(-(stamp_s - known.stamp_s) / options.window_s);
    const Eigen::Vector2d moved_m = now.residual_m - known.residual_m;
    const double step =
        std::min(moved_m.squaredNorm() / (known.cov_m2.trace() + fix.cov_p_m2.trace()), kMostNis);
    const auto mean = [&](double before, double value) { return before + share * (value - before); };
    if (step > kJump) {
      const bool comes_back = now.residual_m.norm() < 0.5 * known.residual_m.norm();
      now.leapt = (known.leapt || known.confirms) && !comes_back;
    }
    if (step <= kJump) {
      now.mean_m = known.mean_m + share * (now.residual_m - known.mean_m);
      if (stamp_s - known.stamp_s <= kVoice_s) now.steady_since_s = known.steady_since_s;
    }
    Eigen::Vector2d rate_mps = moved_m / (stamp_s - known.stamp_s);
    rate_mps *= std::min(1.0, kFastest_mps / std::max(kFastest_mps, rate_mps.norm()));
    now.steps = known.steps + 1;
    now.rate_mps = known.rate_mps + std::max(share, 1.0 / now.steps) * (rate_mps - known.rate_mps);
    now.noise = mean(known.noise, step);
    now.scatter = mean(known.scatter, std::min(step, kMostStep));
    now.contradiction = mean(known.contradiction, 0.5 * now.nis);
    if (!scattersAsClaimed(now)) now.leapt = false;
    if (!scattersAsClaimed(known) && scattersAsClaimed(now)) {  // what was noise is over
      now.noise = 1;
      now.rate_mps.setZero();
      now.steps = 0;
      now.contradiction = 0.5 * now.nis;
    }
    now.with_others_since_s = known.with_others_since_s;
  }
  known = std::move(now);
}

double separation(const Eigen::Vector2d& apart_m, const Eigen::Matrix2d& cov_m2,
                  const ReliabilityOptions& options) {
  const double floor_m = options.separation_m / options.separation_sigmas;
  const Eigen::Matrix2d S = cov_m2 + floor_m * floor_m * Eigen::Matrix2d::Identity();
  return std::sqrt(squaredMahalanobis(apart_m, S));
}

void holdAgainstEachOther(std::vector<SourceRecord>& records, const MotionWitness& motion, double stamp_s,
                          const ReliabilityOptions& options) {
  constexpr std::size_t kMost = 16;
  std::vector<Witness> witnesses{{motion.offset.head<2>(), motion.covariance.topLeftCorner<2, 2>()}};
  std::vector<std::size_t> fresh;  // the record of each witness but the first
  for (std::size_t k = 0; k < records.size() && fresh.size() < kMost; ++k) {
    if (stamp_s - records[k].stamp_s > options.fresh_s || !scattersAsClaimed(records[k])) continue;
    fresh.push_back(k);
    witnesses.push_back({records[k].mean_m, records[k].cov_m2});
  }

  const std::size_t n = witnesses.size();
  std::vector<unsigned> agreeing(n);  // sets of witnesses, as bits
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      if (separation(witnesses[i].mean_m - witnesses[j].mean_m, witnesses[i].cov_m2 + witnesses[j].cov_m2,
                     options) <= options.separation_sigmas)
        agreeing[i] |= 1U << j;

  unsigned winners = 0;
  for (unsigned set = 1; set < 1U << n; ++set) {
    bool all_agree = true;
    for (std::size_t i = 0; i < n && all_agree; ++i)
      all_agree = (set >> i & 1) == 0 || (set & ~agreeing[i]) == 0;
    if (!all_agree) continue;
    const bool larger = sizeOf(set) > sizeOf(winners);
    const bool moves_along = sizeOf(set) == sizeOf(winners) && (set & 1) > (winners & 1);
    if (larger || moves_along) winners = set;
  }

  const double vote_limit = chiSquareLimit(options.confirm_false_alarm, 2);
  const auto hasVoice = [&](const SourceRecord& record) {
    return stamp_s - record.stamp_s <= kVoice_s &&
           stamp_s - record.steady_since_s >= kSteady_windows * options.window_s;
  };
  std::vector<std::size_t> voting;  // the motion does not: it follows whoever has the estimate
  for (std::size_t i = 1; i < n; ++i) {
    const SourceRecord& record = records[fresh[i - 1]];
    if (!record.left && !record.leapt && hasVoice(record)) voting.push_back(i);
  }

  Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < n; ++i)
    if (winners >> i & 1) mean_m += witnesses[i].mean_m / sizeOf(winners);
  for (std::size_t i = 1; i < n; ++i) {
    SourceRecord& record = records[fresh[i - 1]];
    const unsigned against = winners & ~agreeing[i];
    record.supported = fresh.size() < 2 || sizeOf(agreeing[i]) >= 2;
    std::vector<Witness> others;
    for (const std::size_t j : voting)
      if (j != i) others.push_back(witnesses[j]);
    const auto vote = hasVoice(record) ? outvoted(witnesses[i], others, vote_limit) : std::nullopt;
    if (vote || sizeOf(against) >= 2) record.left = true;
    if (!record.left) continue;
    if (against != 0 || vote) {
      record.with_others_since_s.reset();
    } else if (!record.with_others_since_s) {
      record.with_others_since_s = stamp_s;
    }
    if (record.with_others_since_s && stamp_s - *record.with_others_since_s >= options.return_s) {
      record.left = false;
      record.with_others_since_s.reset();
      continue;
    }
    if (vote) {
      record.left_by_m = vote->by_m;
      record.left_limit_m = vote->limit_m;
    } else if (against != 0) {
      record.left_by_m = (record.mean_m - mean_m).norm();
      record.left_limit_m = options.separation_m;
    }
  }
}

double contradictionByAll(const std::vector<SourceRecord>& records, double stamp_s,
                          const ReliabilityOptions& options) {
  double sum = 0;
  std::vector<const SourceRecord*> against;
  for (const SourceRecord& record : records) {
    if (stamp_s - record.stamp_s > options.fresh_s || record.left || record.leapt ||
        !scattersAsClaimed(record))
      continue;
    sum += 0.5 * record.nis;
    for (const SourceRecord* other : against) {
      const Eigen::Vector2d one_m = residualAt(record, stamp_s), two_m = residualAt(*other, stamp_s);
      if ((one_m - two_m).norm() > 0.5 * std::min(one_m.norm(), two_m.norm())) return 1;
    }
    against.push_back(&record);
  }
  return against.size() < 2 ? 1 : std::max(1.0, sum / static_cast<double>(against.size()));
}

}  // namespace raceloc
