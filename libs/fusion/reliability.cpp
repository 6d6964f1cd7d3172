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

/** Whoever may vouch for a position. */
struct Witness {
  Eigen::Vector2d mean_m;
  Eigen::Matrix2d cov_m2;
  SourceRecord* record;  // none: the car's own motion
};

/** Normalised by what both claim. */
double squaredDistance(const Witness& a, const Witness& b) {
  return squaredMahalanobis(a.mean_m - b.mean_m, a.cov_m2 + b.cov_m2);
}

/** The car's motion, then the fresh sources that scatter as they claim, at most 16. */
std::vector<Witness> witnessesOf(std::vector<SourceRecord>& records, const MotionWitness& motion,
                                 double stamp_s, const ReliabilityOptions& options) {
  constexpr std::size_t kMost = 17;  // all 2^17 sets are tried
  std::vector<Witness> witnesses{{motion.offset.head<2>(), motion.covariance.topLeftCorner<2, 2>(), nullptr}};
  for (SourceRecord& record : records) {
    if (witnesses.size() == kMost) break;
    if (stamp_s - record.stamp_s > options.fresh_s || !scattersAsClaimed(record)) continue;
    witnesses.push_back({record.mean_m, record.cov_m2, &record});
  }
  return witnesses;
}

using Set = unsigned;  // of witnesses, a bit each
int sizeOf(Set set) { return __builtin_popcount(set); }

/** Of each witness those that agree with it, itself among them. */
std::vector<Set> agreementsOf(const std::vector<Witness>& witnesses, const ReliabilityOptions& options) {
  std::vector<Set> agreeing(witnesses.size());
  for (std::size_t i = 0; i < witnesses.size(); ++i)
    for (std::size_t j = 0; j < witnesses.size(); ++j)
      if (separation(witnesses[i].mean_m - witnesses[j].mean_m, witnesses[i].cov_m2 + witnesses[j].cov_m2,
                     options) <= options.separation_sigmas)
        agreeing[i] |= 1U << j;
  return agreeing;
}

/** The largest set that agrees with each other; of equally large ones that with the motion, then the first. */
Set largestAgreement(const std::vector<Set>& agreeing) {
  const std::size_t n = agreeing.size();
  Set winners = 0;
  for (Set set = 1; set < 1U << n; ++set) {
    bool all_agree = true;
    for (std::size_t i = 0; i < n && all_agree; ++i)
      all_agree = (set >> i & 1) == 0 || (set & ~agreeing[i]) == 0;
    if (!all_agree) continue;
    const bool larger = sizeOf(set) > sizeOf(winners);
    const bool moves_along = sizeOf(set) == sizeOf(winners) && (set & 1) > (winners & 1);
    if (larger || moves_along) winners = set;
  }
  return winners;
}

Eigen::Vector2d meanOf(Set set, const std::vector<Witness>& witnesses) {
  Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < witnesses.size(); ++i)
    if (set >> i & 1) mean_m += witnesses[i].mean_m / sizeOf(set);
  return mean_m;
}

bool hasVoice(const SourceRecord& record, double stamp_s, const ReliabilityOptions& options) {
  return stamp_s - record.stamp_s <= kVoice_s &&
         stamp_s - record.steady_since_s >= kSteady_windows * options.window_s;
}

/** Who may outvote a source. The motion does not: it follows whoever has the estimate. */
std::vector<Witness> votersAmong(const std::vector<Witness>& witnesses, double stamp_s,
                                 const ReliabilityOptions& options) {
  std::vector<Witness> voters;
  for (const Witness& w : witnesses)
    if (w.record && !w.record->left && !w.record->leapt && hasVoice(*w.record, stamp_s, options))
      voters.push_back(w);
  return voters;
}

/** How far a source is from the others, and how far would do. */
struct Separation {
  double by_m, limit_m;
};

/** The distance of a source from the nearest of the other voters, if two of these agree with each other and none with
 * it. */
std::optional<Separation> outvoted(const Witness& source, std::vector<Witness> voters, double limit) {
  voters.erase(std::remove_if(voters.begin(), voters.end(),
                              [&](const Witness& w) { return w.record == source.record; }),
               voters.end());
  bool two_agree = false;
  double nearest = HUGE_VAL, nearest_m = HUGE_VAL;
  for (auto one = voters.begin(); one != voters.end(); ++one) {
    two_agree = two_agree || std::any_of(voters.begin(), one, [&](const Witness& other) {
                  return squaredDistance(other, *one) <= limit;
                });
    const double distance = squaredDistance(source, *one);
    if (distance < nearest) {
      nearest = distance;
      nearest_m = (source.mean_m - one->mean_m).norm();
    }
  }
  if (!two_agree || nearest <= limit) return std::nullopt;
  return Separation{nearest_m, nearest_m * std::sqrt(limit / nearest)};
}

/** Of a source that has left. \param apart  none: it agrees with the others just now */
void stayAwayOrReturn(SourceRecord& record, const std::optional<Separation>& apart, double stamp_s,
                      double return_s) {
  if (apart) {
    record.with_others_since_s.reset();
    record.left_by_m = apart->by_m;
    record.left_limit_m = apart->limit_m;
    return;
  }
  if (!record.with_others_since_s) record.with_others_since_s = stamp_s;
  if (stamp_s - *record.with_others_since_s < return_s) return;
  record.left = false;
  record.with_others_since_s.reset();
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
  const std::vector<Witness> witnesses = witnessesOf(records, motion, stamp_s, options);
  const std::vector<Set> agreeing = agreementsOf(witnesses, options);
  const Set winners = largestAgreement(agreeing);
  const Eigen::Vector2d mean_m = meanOf(winners, witnesses);
  const std::vector<Witness> voters = votersAmong(witnesses, stamp_s, options);
  const double vote_limit = chiSquareLimit(options.confirm_false_alarm, 2);
  const bool has_others = witnesses.size() > 2;

  for (std::size_t i = 1; i < witnesses.size(); ++i) {
    SourceRecord& record = *witnesses[i].record;
    record.supported = !has_others || sizeOf(agreeing[i]) >= 2;
    const Set against = winners & ~agreeing[i];
    std::optional<Separation> apart;
    if (hasVoice(record, stamp_s, options)) apart = outvoted(witnesses[i], voters, vote_limit);
    if (apart || sizeOf(against) >= 2) record.left = true;
    if (!apart && against != 0) apart = Separation{(record.mean_m - mean_m).norm(), options.separation_m};
    if (record.left) stayAwayOrReturn(record, apart, stamp_s, options.return_s);
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
