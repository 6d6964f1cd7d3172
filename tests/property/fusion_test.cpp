#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "core/types.h"
#include "fusion/chi_square.h"
#include "fusion/fusion_filter.h"
#include "fusion/measurement.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

constexpr double kPi = 3.14159265358979323846;
// Sums and roots of doubles of a few hundred metres, some digits lost in a 2x2 or 4x4 solve.
constexpr double kRounding = 1e-9;

Eigen::Matrix2d rotation(double angle_rad) { return Eigen::Rotation2Dd(angle_rad).toRotationMatrix(); }

Eigen::Matrix2d anyCovariance(Random& rnd) {
  const Eigen::Vector2d sigma(rnd.uniform(0.05, 3), rnd.uniform(0.05, 3));
  const Eigen::Matrix2d R = rotation(rnd.uniform(-kPi, kPi));
  const Eigen::Matrix2d C = R * sigma.cwiseAbs2().asDiagonal() * R.transpose();
  return 0.5 * (C + C.transpose());
}

CarState anyState(Random& rnd) {
  Eigen::Matrix4d A;
  for (double& a : A.reshaped()) a = rnd.uniform(-1, 1);
  const Eigen::Vector4d scale(1, 1, 0.1, 0.1);
  const Eigen::Matrix4d P =
      scale.asDiagonal() * (A * A.transpose() + 0.01 * Eigen::Matrix4d::Identity()) * scale.asDiagonal();
  return {{rnd.uniform(-200, 200), rnd.uniform(-200, 200), rnd.uniform(-kPi, kPi), rnd.uniform(-0.1, 0.1)},
          0.5 * (P + P.transpose())};
}

/** K fixes within `reach_m` of the state, of every kind. */
std::vector<PoseFix> anyFixes(Random& rnd, const CarState& state, int K, double reach_m) {
  std::vector<PoseFix> fixes;
  for (int k = 0; k < K; ++k) {
    const Eigen::Vector2d away =
        rotation(rnd.uniform(-kPi, kPi)) * Eigen::Vector2d(rnd.uniform(0, reach_m), 0);
    PoseFix fix{"gps_" + std::to_string(k), state.mean.head<2>() + away, anyCovariance(rnd)};
    fix.heading = rnd.oneOf({HeadingKind::none, HeadingKind::body, HeadingKind::course});
    if (fix.heading != HeadingKind::none) {
      fix.heading_rad = wrapAngle(state.mean(2) + rnd.uniform(-0.3, 0.3));
      fix.heading_sigma_rad = rnd.uniform(0.01, 0.2);
    }
    fixes.push_back(fix);
  }
  return fixes;
}

GateOptions anyGate(Random& rnd) {
  GateOptions options;
  options.metric = rnd.oneOf({GateMetric::metric, GateMetric::chi2});
  options.primary_order = rnd.oneOf<const char*>({"gps_*", "gps_2 gps_*", "none_such", "gps_3, gps_1"});
  return options;
}

CarState rotated(const CarState& state, double angle_rad) {
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<2, 2>() = rotation(angle_rad);
  Eigen::Vector4d mean = T * state.mean;
  mean(2) = wrapAngle(mean(2) + angle_rad);
  return {mean, T * state.covariance * T.transpose()};
}

PoseFix rotated(PoseFix fix, double angle_rad) {
  const Eigen::Matrix2d R = rotation(angle_rad), C = R * fix.cov_p_m2 * R.transpose();
  fix.p_map_m = (R * fix.p_map_m).eval();
  fix.cov_p_m2 = 0.5 * (C + C.transpose());
  if (fix.heading != HeadingKind::none) fix.heading_rad = wrapAngle(fix.heading_rad + angle_rad);
  return fix;
}

std::vector<PoseFix> rotated(std::vector<PoseFix> fixes, double angle_rad) {
  for (PoseFix& fix : fixes) fix = rotated(fix, angle_rad);
  return fixes;
}

void expectSameState(const CarState& a, const CarState& b, double tolerance) {
  Eigen::Vector4d difference = a.mean - b.mean;
  difference(2) = wrapAngle(difference(2));
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), tolerance);
  EXPECT_LT((a.covariance - b.covariance).cwiseAbs().maxCoeff(), tolerance);
}

TEST(GateProperty, WeightsAddUpToOneAndRejectedSourcesHaveNone) {
  forAll(500, [](Random& rnd) {
    const CarState state = anyState(rnd);
    const auto fixes = anyFixes(rnd, state, rnd.integer(1, 5), rnd.oneOf({0.0, 0.1, 3.0, 12.0}));
    const auto [decision, fused] = gate(state, fixes, anyGate(rnd));

    double sum = 0;
    std::size_t accepted = 0;
    for (std::size_t k = 0; k < fixes.size(); ++k) {
      const SourceVerdict& verdict = decision.sources[k];
      EXPECT_EQ(verdict.source, fixes[k].source);
      EXPECT_EQ(verdict.accepted, verdict.delta <= verdict.limit);
      EXPECT_LE(verdict.p_theta, 0.5);
      EXPECT_GE(verdict.weight, 0);
      EXPECT_TRUE(verdict.accepted || verdict.weight == 0);
      EXPECT_TRUE(verdict.p_theta > 0 || verdict.delta > 700);  // where it underflows
      accepted += verdict.accepted ? 1 : 0;
      sum += verdict.weight;
    }
    EXPECT_NEAR(sum, accepted > 0 ? 1 : 0, 1e-14);
    EXPECT_EQ(decision.rule == GateRule::rejected_all, accepted == 0);
    EXPECT_EQ(decision.rule == GateRule::rejected_some, accepted > 0 && accepted < fixes.size());
    EXPECT_EQ(decision.alarm, accepted == 0);
    EXPECT_EQ(fused.has_value(), accepted > 0);
  });
}

TEST(GateProperty, WeightsOfRuleTwoAddUpToOneAndFallWithTheDistance) {
  for (int K = 1; K <= 5; ++K)
    forAll(100, [K](Random& rnd) {
      std::vector<double> deltas(static_cast<std::size_t>(K));
      for (double& delta : deltas) delta = rnd.oneOf({0.0, 1e-300, rnd.uniform(0, 5)});
      const auto weights = blendWeights(deltas);
      double sum = 0;
      for (std::size_t i = 0; i < weights.size(); ++i) {
        sum += weights[i];
        EXPECT_GE(weights[i], 0);
        for (std::size_t j = 0; j < weights.size(); ++j)
          EXPECT_TRUE(deltas[i] >= deltas[j] || weights[i] >= weights[j]);
      }
      EXPECT_NEAR(sum, 1, 1e-14);
    });
}

TEST(GateProperty, TheOrderOfTheSourcesChangesNotOneBit) {
  forAll(300, [](Random& rnd) {
    const CarState state = anyState(rnd);
    const GateOptions options = anyGate(rnd);
    auto fixes = anyFixes(rnd, state, rnd.integer(2, 5), rnd.oneOf({0.1, 3.0, 12.0}));
    const auto before = gate(state, fixes, options);
    for (std::size_t i = fixes.size(); i-- > 1;)
      std::swap(fixes[i], fixes[static_cast<std::size_t>(rnd.integer(0, static_cast<int>(i)))]);
    const auto after = gate(state, fixes, options);

    EXPECT_EQ(before.decision.rule, after.decision.rule);
    for (const auto& a : before.decision.sources) {
      const auto b = std::find_if(after.decision.sources.begin(), after.decision.sources.end(),
                                  [&](const auto& verdict) { return verdict.source == a.source; });
      ASSERT_NE(b, after.decision.sources.end());
      EXPECT_EQ(a.delta, b->delta);
      EXPECT_EQ(a.limit, b->limit);
      EXPECT_EQ(a.p_theta, b->p_theta);
      EXPECT_EQ(a.weight, b->weight);
      EXPECT_EQ(a.accepted, b->accepted);
    }
    ASSERT_EQ(before.fused.has_value(), after.fused.has_value());
    if (!before.fused) return;
    EXPECT_EQ(before.fused->source, after.fused->source);
    EXPECT_EQ(before.fused->p_map_m, after.fused->p_map_m);
    EXPECT_EQ(before.fused->cov_p_m2, after.fused->cov_p_m2);
    EXPECT_EQ(before.fused->heading, after.fused->heading);
    EXPECT_EQ(before.fused->heading_rad, after.fused->heading_rad);
    EXPECT_EQ(before.fused->heading_sigma_rad, after.fused->heading_sigma_rad);
  });
}

TEST(GateProperty, MetricDistanceIsInMetres) {
  forAll(200, [](Random& rnd) {
    const CarState state = anyState(rnd);
    auto fixes = anyFixes(rnd, state, 1, 12);
    const auto deltaOf = [&] { return gate(state, fixes, GateOptions()).decision.sources[0].delta; };
    const double delta_m = deltaOf();
    fixes[0].cov_p_m2 *= rnd.uniform(0.01, 100);  // how good a source says it is, as a whole, does not count
    EXPECT_NEAR(deltaOf(), delta_m, kRounding);
    fixes[0].cov_p_m2 = rnd.uniform(0.01, 9) * Eigen::Matrix2d::Identity();
    EXPECT_NEAR(deltaOf(), (fixes[0].p_map_m - state.mean.head<2>()).norm(), kRounding);
  });
}

TEST(GateProperty, TheMapMayBeTurned) {
  forAll(300, [](Random& rnd) {
    const double angle_rad = rnd.uniform(-kPi, kPi);
    const CarState state = anyState(rnd);
    const GateOptions options = anyGate(rnd);
    const auto fixes = anyFixes(rnd, state, rnd.integer(1, 5), rnd.oneOf({0.1, 3.0, 12.0}));
    const auto plain = gate(state, fixes, options);
    const auto turned = gate(rotated(state, angle_rad), rotated(fixes, angle_rad), options);
    EXPECT_EQ(plain.decision.rule, turned.decision.rule);
    for (std::size_t k = 0; k < fixes.size(); ++k) {
      const double delta = plain.decision.sources[k].delta;
      EXPECT_NEAR(turned.decision.sources[k].delta, delta, kRounding * (1 + delta));
      EXPECT_NEAR(turned.decision.sources[k].weight, plain.decision.sources[k].weight, kRounding);
    }
    ASSERT_EQ(plain.fused.has_value(), turned.fused.has_value());
    if (!plain.fused) return;
    const PoseFix expected = rotated(*plain.fused, angle_rad);
    EXPECT_EQ(turned.fused->source, expected.source);
    EXPECT_LT((turned.fused->p_map_m - expected.p_map_m).norm(), kRounding);
    EXPECT_LT((turned.fused->cov_p_m2 - expected.cov_p_m2).norm(), kRounding);
    EXPECT_EQ(turned.fused->heading, expected.heading);
    EXPECT_NEAR(wrapAngle(turned.fused->heading_rad - expected.heading_rad), 0, kRounding);
    EXPECT_NEAR(turned.fused->heading_sigma_rad, expected.heading_sigma_rad, kRounding);
  });
}

TEST(ChiSquareProperty, TheTailBeyondTheLimitIsTheProbability) {
  forAll(300, [](Random& rnd) {
    const double p = rnd.oneOf({std::pow(10, rnd.uniform(-12, 0)), 1 - std::pow(10, rnd.uniform(-9, -1))});
    const double x = chiSquareLimit(p, 3);
    const double tail = std::erfc(std::sqrt(x / 2)) + std::sqrt(2 * x / kPi) * std::exp(-x / 2);
    EXPECT_NEAR(tail / p, 1, 1e-12);
    EXPECT_NEAR(std::exp(-chiSquareLimit(p, 2) / 2) / p, 1, 1e-12);
  });
}

/** The same filter written from the contract alone: Jacobians by central differences, Joseph form. */
struct ReferenceFilter {
  Eigen::Vector4d x;
  Eigen::Matrix4d P;
  FusionOptions options;

  template <int N, int M>
  static Eigen::Matrix<double, N, M> slope(
      const std::function<Eigen::Matrix<double, N, 1>(const Eigen::Matrix<double, M, 1>&)>& f,
      const Eigen::Matrix<double, M, 1>& at) {
    Eigen::Matrix<double, N, M> J;
    for (int j = 0; j < M; ++j) {
      Eigen::Matrix<double, M, 1> step = Eigen::Matrix<double, M, 1>::Zero();
      step(j) = 1e-5;
      J.col(j) = (f(at + step) - f(at - step)) / 2e-5;
    }
    return J;
  }

  void predict(double T, double speed_mps, double yaw_rate_rps) {
    const auto move = [&](const Eigen::Matrix<double, 6, 1>& xu) -> Eigen::Vector4d {
      const double middle = xu(2) + xu(3) + xu(5) * T / 2;
      return {xu(0) + xu(4) * T * std::cos(middle), xu(1) + xu(4) * T * std::sin(middle), xu(2) + xu(5) * T,
              xu(3) * std::exp(-T / options.bias_time_s)};
    };
    Eigen::Matrix<double, 6, 1> xu;
    xu << x, speed_mps, yaw_rate_rps;
    const Eigen::Matrix<double, 4, 6> J = slope<4, 6>(move, xu);
    // The mean of white noise over T has 1/T of the variance over one second.
    Eigen::Matrix<double, 6, 6> joint = Eigen::Matrix<double, 6, 6>::Zero();
    joint.topLeftCorner<4, 4>() = P;
    joint(4, 4) = options.speed_sigma_mps * options.speed_sigma_mps / T;
    joint(5, 5) = options.yaw_rate_sigma_rps * options.yaw_rate_sigma_rps / T;
    P = J * joint * J.transpose();
    const double kept = std::exp(-T / options.bias_time_s);
    P(3, 3) += options.bias_sigma_rad * options.bias_sigma_rad * (1 - kept * kept);
    x = move(xu);
    x(2) = wrapAngle(x(2));
  }

  void correct(const PoseFix& fix) {
    // As many rows as are measured: no emptied ones.
    const bool heading = fix.heading != HeadingKind::none;
    const auto measure = [&](const Eigen::Vector4d& s) -> Eigen::Vector3d {
      return {s(0), s(1), fix.heading == HeadingKind::course ? s(2) + s(3) : s(2)};
    };
    const Eigen::Index n = heading ? 3 : 2;
    const Eigen::MatrixXd H = slope<3, 4>(measure, x).topRows(n);
    Eigen::MatrixXd R = Eigen::MatrixXd::Zero(n, n);
    R.topLeftCorner(2, 2) = fix.cov_p_m2;
    Eigen::VectorXd nu(n);
    nu.head(2) = fix.p_map_m - x.head<2>();
    if (heading) {
      R(2, 2) = fix.heading_sigma_rad * fix.heading_sigma_rad;
      nu(2) = std::remainder(fix.heading_rad - measure(x)(2), 2 * kPi);
    }
    const Eigen::MatrixXd K = P * H.transpose() * (H * P * H.transpose() + R).inverse();
    const Eigen::Matrix4d I_KH = Eigen::Matrix4d::Identity() - K * H;
    x += K * nu;
    x(2) = wrapAngle(x(2));
    P = (I_KH * P * I_KH.transpose() + K * R * K.transpose()).eval();
  }
};

TEST(FilterProperty, AgreesWithAFilterOfFiniteDifferences) {
  forAll(50, [](Random& rnd) {
    FusionOptions options;
    options.speed_sigma_mps = rnd.uniform(0.01, 0.5);
    options.yaw_rate_sigma_rps = rnd.uniform(0.001, 0.05);
    options.bias_time_s = rnd.uniform(1, 30);
    const CarState start = anyState(rnd);
    FusionFilter filter(start, options, GateOptions());
    ReferenceFilter reference{start.mean, start.covariance, options};
    for (int i = 0; i < 30; ++i) {
      const double T = rnd.uniform(0.005, 0.2), v = rnd.uniform(-5, 80), w = rnd.uniform(-1, 1);
      filter.predict(T, v, w);
      reference.predict(T, v, w);
      if (rnd.integer(0, 2) > 0) continue;
      const auto fixes = anyFixes(rnd, filter.state(), 1, 1);
      const GateDecision decision = filter.correct(fixes);
      if (decision.alarm) continue;  // metric distance of a very flat covariance
      reference.correct(fixes[0]);
    }
    // Central differences: 1e-10 of slope by their step, 1e-16 * 200 m / 1e-5 by rounding, over 30 steps of
    // up to 16 m.
    expectSameState(filter.state(), {reference.x, reference.P}, 1e-6);
  });
}

TEST(FilterProperty, TheMapMayBeTurned) {
  forAll(50, [](Random& rnd) {
    const double angle_rad = rnd.uniform(-kPi, kPi);
    const CarState start = anyState(rnd);
    FusionFilter plain(start, {}, {}), turned(rotated(start, angle_rad), {}, {});
    for (int i = 0; i < 20; ++i) {
      const double T = rnd.uniform(0, 0.2), v = rnd.uniform(-5, 80), w = rnd.uniform(-1, 1);
      plain.predict(T, v, w);
      turned.predict(T, v, w);
      const auto fixes = anyFixes(rnd, plain.state(), rnd.integer(1, 3), 3);
      plain.correct(fixes);
      turned.correct(rotated(fixes, angle_rad));
    }
    expectSameState(rotated(plain.state(), angle_rad), turned.state(), kRounding);
  });
}

TEST(FilterProperty, AStepInTwoHalvesIsTheStep) {
  forAll(200, [](Random& rnd) {
    const CarState start{anyState(rnd).mean, Eigen::Matrix4d::Zero()};
    const double T = rnd.oneOf({0.0, 0.001, 0.01, 0.02}), v = rnd.uniform(0, 80), w = rnd.uniform(-1, 1);
    const FusionOptions options;
    FusionFilter once(start, options, {}), twice(start, options, {});
    once.predict(T, v, w);
    twice.predict(T / 2, v, w);
    twice.predict(T / 2, v, w);

    const CarState a = once.state(), b = twice.state();
    // The chords of two halves are shorter by (w T)^2 / 32, and the second turns by the b T / (2 bias_time_s)
    // that b has lost; angles are exact.
    const double chord_m =
        v * T * (w * w * T * T / 32 + std::abs(start.mean(3)) * T / (2 * options.bias_time_s));
    EXPECT_LT((a.mean - b.mean).head<2>().norm(), chord_m + 1e-12);
    EXPECT_NEAR(wrapAngle(a.mean(2) - b.mean(2)), 0, 1e-12);
    EXPECT_NEAR(a.mean(3), b.mean(3), 1e-12);
    // Noise of first order in T is the same; noise of the first half carried through the second is third
    // order, at most (v T)^2 / 16 of the yaw rate's and as much of b's: 1 % of the whole at 1.6 m. (Noise
    // that grew with the square of the step would be off by half.)
    EXPECT_LE((a.covariance - b.covariance).norm(), 0.01 * a.covariance.norm());
  });
}

TEST(FilterProperty, StraightDeadReckoningHasItsClosedForm) {
  forAll(20, [](Random& rnd) {
    FusionOptions options;
    options.speed_sigma_mps = rnd.uniform(0.01, 0.5);
    options.yaw_rate_sigma_rps = rnd.uniform(0.001, 0.02);
    options.bias_sigma_rad = rnd.uniform(0, 0.05);
    options.bias_time_s = rnd.uniform(2, 60);
    const CarState start = startState({0, 0}, 0, options);
    const double v = rnd.uniform(1, 80), t = 5, step_s = 0.005;
    FusionFilter filter(start, options, {});
    for (int i = 0; i < 1000; ++i) filter.predict(step_s, v, 0);

    // White noise once and twice integrated, and the integral of a stationary Gauss-Markov process.
    const double tau = options.bias_time_s;
    const double along =
        std::pow(options.start_position_sigma_m, 2) + std::pow(options.speed_sigma_mps, 2) * t;
    const double turn =
        std::pow(options.start_heading_sigma_rad, 2) + std::pow(options.yaw_rate_sigma_rps, 2) * t;
    const double slip =
        std::pow(options.bias_sigma_rad, 2) * 2 * tau * tau * (t / tau - 1 + std::exp(-t / tau));
    const double across = std::pow(options.start_position_sigma_m, 2) +
                          v * v *
                              (std::pow(options.start_heading_sigma_rad * t, 2) +
                               std::pow(options.yaw_rate_sigma_rps, 2) * t * t * t / 3 + slip);
    const CarState state = filter.state();
    EXPECT_NEAR(state.covariance(0, 0) / along, 1, 1e-9);
    EXPECT_NEAR(state.covariance(2, 2) / turn, 1, 1e-9);
    EXPECT_NEAR(state.covariance(1, 1) / across, 1, 2 * step_s / tau);  // b stands still within a step
    EXPECT_NEAR(state.mean(0), v * t, 1e-9);
  });
}

TEST(FilterProperty, AFixBringsExactlyItsOwnInformation) {
  forAll(200, [](Random& rnd) {
    const CarState start = anyState(rnd);
    FusionFilter filter(start, {}, {});
    auto fixes = anyFixes(rnd, start, 1, 0.1);
    filter.correct(fixes);
    const Eigen::Matrix4d before = start.covariance.inverse(), after = filter.state().covariance.inverse();

    Eigen::Matrix4d expected = Eigen::Matrix4d::Zero();
    expected.topLeftCorner<2, 2>() = fixes[0].cov_p_m2.inverse();
    if (fixes[0].heading != HeadingKind::none) {
      const double information = std::pow(fixes[0].heading_sigma_rad, -2);
      expected(2, 2) = information;
      if (fixes[0].heading == HeadingKind::course)
        expected(2, 3) = expected(3, 2) = expected(3, 3) = information;
    }
    // Without a heading the rows of theta and b stay zero. Two inverses at a condition of up to 1e6.
    const double scale = before.cwiseAbs().maxCoeff() + after.cwiseAbs().maxCoeff();
    EXPECT_LT((after - before - expected).cwiseAbs().maxCoeff(), 1e-9 * scale);
  });
}

TEST(FilterProperty, TheCovarianceStaysSymmetricAndPositive) {
  forAll(20, [](Random& rnd) {
    FusionFilter filter(anyState(rnd), {}, anyGate(rnd));
    for (int i = 0; i < 500; ++i) {
      filter.predict(rnd.uniform(0, 0.05), rnd.uniform(-5, 80), rnd.uniform(-1, 1));
      filter.correct(anyFixes(rnd, filter.state(), rnd.integer(1, 3), rnd.oneOf({0.1, 3.0})));
    }
    const Eigen::Matrix4d P = filter.state().covariance;
    EXPECT_EQ(P, P.transpose());
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(P).eigenvalues().minCoeff(), 0);
    EXPECT_LE(std::abs(filter.state().mean(2)), kPi);
  });
}

/** A car whose truth is drawn from the filter's own model, and the filter that drives it. */
class SimulatedDrive {
 public:
  SimulatedDrive(Random& rnd, const FusionOptions& options)
      : x_rnd(rnd), x_options(options), x_filter(startState({0, 0}, 0.5, options), options, GateOptions()) {
    const CarState start = x_filter.state();
    for (int i = 0; i < 4; ++i) x_truth(i) = start.mean(i) + rnd.normal(std::sqrt(start.covariance(i, i)));
  }

  void setBias(double b_rad) { x_truth(3) = b_rad; }

  void step(double T, double speed_mps, double yaw_rate_rps) {
    x_filter.predict(T, speed_mps, yaw_rate_rps);
    const double v = speed_mps + x_rnd.normal(x_options.speed_sigma_mps / std::sqrt(T));
    const double w = yaw_rate_rps + x_rnd.normal(x_options.yaw_rate_sigma_rps / std::sqrt(T));
    const double course_rad = x_truth(2) + x_truth(3) + w * T / 2,
                 kept = std::exp(-T / x_options.bias_time_s);
    x_truth(0) += v * T * std::cos(course_rad);
    x_truth(1) += v * T * std::sin(course_rad);
    x_truth(2) += w * T;
    x_truth(3) = kept * x_truth(3) + x_rnd.normal(x_options.bias_sigma_rad * std::sqrt(1 - kept * kept));
  }

  GateDecision measure(HeadingKind kind, double position_sigma_m, double heading_sigma_rad) {
    PoseFix fix{"gps",
                x_truth.head<2>() + position_sigma_m * Eigen::Vector2d(x_rnd.normal(), x_rnd.normal()),
                position_sigma_m * position_sigma_m * Eigen::Matrix2d::Identity(),
                kind,
                0,
                heading_sigma_rad};
    if (kind != HeadingKind::none)
      fix.heading_rad = wrapAngle(x_truth(2) + (kind == HeadingKind::course ? x_truth(3) : 0) +
                                  x_rnd.normal(heading_sigma_rad));
    return x_filter.correct({fix});
  }

  [[nodiscard]] Eigen::Vector4d error() const {
    Eigen::Vector4d e = x_filter.state().mean - x_truth;
    e(2) = wrapAngle(e(2));
    return e;
  }
  [[nodiscard]] Eigen::Matrix4d covariance() const { return x_filter.state().covariance; }
  [[nodiscard]] double nees() const { return error().dot(covariance().llt().solve(error())); }

 private:
  Random& x_rnd;
  FusionOptions x_options;
  Eigen::Vector4d x_truth;
  FusionFilter x_filter;
};

TEST(FilterProperty, CourseOnlyMakesTheBiasObservableOnceTheHeadingIsKnown) {
  forAll(20, [](Random& rnd) {
    FusionOptions options;
    options.start_heading_sigma_rad = 0.001;
    options.yaw_rate_sigma_rps = 1e-5;
    options.bias_sigma_rad = 0.05;
    options.bias_time_s = 1e5;  // a mounting error: it stays
    SimulatedDrive drive(rnd, options);
    drive.setBias(rnd.uniform(-0.05, 0.05));
    for (int i = 0; i < 400; ++i) {
      drive.step(0.05, 20, 0.2);
      drive.measure(HeadingKind::course, 1, 0.02);
    }
    // 400 courses to 0.02 rad, the heading to 0.001 rad: b to about 0.0015 rad.
    const double sigma_rad = std::sqrt(drive.covariance()(3, 3));
    EXPECT_LT(sigma_rad, 0.002);
    EXPECT_LT(std::abs(drive.error()(3)), 4 * sigma_rad);
  });
}

TEST(FilterProperty, CoursesNeverTellTheHeadingFromTheBias) {
  forAll(20, [](Random& rnd) {
    FusionOptions options;
    options.yaw_rate_sigma_rps = 1e-5;
    options.start_heading_sigma_rad = options.bias_sigma_rad = 0.1;
    options.bias_time_s = 1e5;
    SimulatedDrive drive(rnd, options);
    for (int i = 0; i < 400; ++i) {
      drive.step(0.05, 20, 0);
      drive.measure(HeadingKind::course, 1, 0.02);
    }
    // Their sum becomes known; their difference keeps the sigma of the start, 0.1 sqrt(2).
    const Eigen::Matrix2d P = drive.covariance().bottomRightCorner<2, 2>();
    EXPECT_LT(std::sqrt(P.sum()), 0.002);
    EXPECT_NEAR(std::sqrt(P(0, 0) + P(1, 1) - 2 * P(0, 1)), 0.1 * std::sqrt(2), 0.002);
  });
}

/** P(chi-square with n even degrees of freedom > x): a sum of Poisson terms. */
double evenChiSquareTail(double x, int n) {
  double term = std::exp(-x / 2), sum = 0;
  for (int i = 0; i < n / 2; ++i) {
    sum += term;
    term *= x / 2 / (i + 1);
  }
  return sum;
}

double evenChiSquareQuantile(double probability, int n) {
  double low = 0, high = 10.0 * n;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (evenChiSquareTail(middle, n) > 1 - probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

TEST(FilterProperty, ErrorsAreAsLargeAsTheFilterSays) {
  constexpr int kEpochs = 20;
  std::array<double, kEpochs> sum{};
  const int runs = forAll(100, [&](Random& rnd) {
    SimulatedDrive drive(rnd, FusionOptions());
    const std::array<HeadingKind, 3> kinds{HeadingKind::none, HeadingKind::course, HeadingKind::body};
    for (double& at_epoch : sum) {
      for (std::size_t i = 0; i < 20; ++i) {  // 2 s
        drive.step(0.1, 40, 0.3);
        const auto decision = drive.measure(kinds[i % 3], 0.3, 0.02);
        ASSERT_FALSE(decision.alarm);
      }
      at_epoch += drive.nees();
    }
  });
  // The sum over the runs is chi-square with 4 degrees of freedom a run.
  const double low = evenChiSquareQuantile(0.025, 4 * runs), high = evenChiSquareQuantile(0.975, 4 * runs);
  EXPECT_NEAR(evenChiSquareQuantile(0.025, 240), 198.984, 5e-4);  // printed tables
  EXPECT_NEAR(evenChiSquareQuantile(0.975, 240), 284.802, 5e-4);
  const auto inside =
      std::count_if(sum.begin(), sum.end(), [&](double nees) { return nees > low && nees < high; });
  EXPECT_GE(inside, 17);  // of 20: fewer come by chance once in 60 times
}

}  // namespace
}  // namespace raceloc
