#include "raceloc/gpu/covariance.h"

#include <limits>

#include "core/eig3.hpp"
#include "tests/on_each_device.h"
#include "tests/reference.h"

namespace raceloc::gpu::test {
namespace {

class CovarianceKernels : public OnEachDevice {};
INSTANTIATE_TEST_SUITE_P(Devices, CovarianceKernels, ::testing::Values(Backend::cpu, Backend::cuda),
                         deviceName);

constexpr double kGap = 1e-3;  // below it a normal is undefined

CovarianceOptions withOdds(Weight weight) {  // no parameter at a value where it would not show
  CovarianceOptions o;
  o.weight = weight;
  o.radius_m = 0.9F;
  o.rbf_gamma_per_m2 = 1.7F;
  o.gaussian_sigma_m = 0.4F;
  o.laplacian_sigma_m = 0.3F;
  o.polynomial_alpha_per_m2 = 2.5F;
  o.polynomial_c = 0.7F;
  o.polynomial_degree = 3;
  o.hist_s_m = 0.35F;
  o.plane_epsilon = 0.01F;
  return o;
}

double largestDifference(const Matrix& A, const Matrix& B) {
  double largest = 0;
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c) largest = std::max(largest, std::fabs(A[r][c] - B[r][c]));
  return largest;
}

TEST_P(CovarianceKernels, AreTheWeightedSumsOverAllPairs) {
  const Points p = hall(5, 3000);
  for (const Weight weight : kWeights) {
    CovarianceOptions o = withOdds(weight);
    o.regularisation = Regularisation::none;
    const Covariances C = covariances(context(), p.view(), o);
    ASSERT_EQ(C.size(), p.size());
    for (std::size_t i = 0; i < p.size(); i += 7) {
      const RawCovariance expected = rawCovariance(p, i, o);
      if (expected.on_the_rim) continue;
      ASSERT_EQ(C.neighbours[i], expected.neighbours);
      if (expected.neighbours < o.min_neighbours) continue;
      EXPECT_LT(largestDifference(matrixAt(C, i), expected.C), 1e-6) << i;  // float sums of 1e-6 of radius^2
    }
  }
}

TEST_P(CovarianceKernels, ArePlanesAfterPlaneRegularisation) {
  const Points p = hall(6, 3000);
  int checked = 0;
  for (const Weight weight : kWeights) {
    const CovarianceOptions o = withOdds(weight);
    const Covariances C = covariances(context(), p.view(), o);
    for (std::size_t i = 0; i < p.size(); i += 7) {
      const RawCovariance raw = rawCovariance(p, i, o);
      const Vector values = eigenvalues(raw.C);
      const double gap = (values[1] - values[0]) / values[2];
      if (raw.on_the_rim || raw.neighbours < o.min_neighbours || gap < 1.2 * kGap) continue;
      const Matrix expected = withEigenvalues(raw.C, {static_cast<double>(o.plane_epsilon), 1, 1});
      EXPECT_LT(largestDifference(matrixAt(C, i), expected), 1e-5 / gap)
          << i;  // a normal turns by error / gap
      ++checked;
    }
  }
  EXPECT_GT(checked, 1500);
}

TEST_P(CovarianceKernels, HaveNoSmallEigenvalueAfterMinEig) {
  const Points p = hall(8, 3000);
  for (const Weight weight : kWeights) {
    CovarianceOptions o = withOdds(weight);
    o.regularisation = Regularisation::min_eig;
    o.plane_epsilon = 0.1F;
    const Covariances C = covariances(context(), p.view(), o);
    for (std::size_t i = 0; i < p.size(); i += 7) {
      const RawCovariance raw = rawCovariance(p, i, o);
      if (raw.on_the_rim || raw.neighbours < o.min_neighbours) continue;
      const Vector values = eigenvalues(raw.C);
      const double gap = std::min(values[1] - values[0], values[2] - values[1]) / values[2];
      if (gap < kGap) continue;  // the reference's vectors are undefined there
      const double floor = 0.1 * values[2];
      const Matrix expected =
          withEigenvalues(raw.C, {std::max(values[0], floor), std::max(values[1], floor), values[2]});
      EXPECT_LT(largestDifference(matrixAt(C, i), expected), 3e-6) << i;  // float eigen-decomposition of 1e-6
    }
  }
}

TEST_P(CovarianceKernels, TurnWithTheCloud) {
  const Points p = hall(9, 2000);
  const Transform T = pose({0.3, -0.5, 1.1}, {3, -2, 1});
  const Matrix R = rotationOf(T);
  for (const Weight weight : kWeights) {
    if (weight == Weight::hist) continue;  // |d|_1 depends on the axes
    CovarianceOptions o = withOdds(weight);
    o.regularisation = Regularisation::none;
    const Covariances here = covariances(context(), p.view(), o);
    const Points turned_points = applied(T, p);
    const Covariances there = covariances(context(), turned_points.view(), o);
    for (std::size_t i = 0; i < p.size(); i += 5) {
      if (here.neighbours[i] != there.neighbours[i]) continue;  // one on the rim
      const Matrix expected = product(product(R, matrixAt(here, i)), flipped(R));
      EXPECT_LT(largestDifference(matrixAt(there, i), expected), 3e-6);  // coordinates rounded at 15 m
    }
  }
}

TEST_P(CovarianceKernels, SayWhenTheyKnowNothing) {
  Points p;
  push(p, 0, 0, 0);                                           // alone
  for (int i = 0; i < 30; ++i) push(p, 50 + 0.05 * i, 0, 0);  // a line: no normal
  for (int i = 0; i < 30; ++i) push(p, 0, 70, 0);             // one place
  for (const Regularisation how : {Regularisation::plane, Regularisation::min_eig}) {
    CovarianceOptions o = withOdds(Weight::laplacian);
    o.regularisation = how;
    const Covariances C = covariances(context(), p.view(), o);
    const double radius2 = static_cast<double>(o.radius_m) * static_cast<double>(o.radius_m);
    const double variance = how == Regularisation::plane ? 4 : radius2;
    const Matrix unknown{{{variance, 0, 0}, {0, variance, 0}, {0, 0, variance}}};
    EXPECT_EQ(C.neighbours[0], 1);
    EXPECT_LT(largestDifference(matrixAt(C, 0), unknown), 1e-6);
    EXPECT_EQ(C.neighbours[40], 30);
    EXPECT_LT(largestDifference(matrixAt(C, 40), unknown), 1e-6);
    if (how == Regularisation::plane) {
      EXPECT_LT(largestDifference(matrixAt(C, 15), unknown), 1e-6);
    }
  }
}

TEST_P(CovarianceKernels,
       FindNeighboursFarFromTheOrigin) {  // beyond 2^20 cells of 0.05 m, where a float is 1/128 m
  Points p;
  for (int i = 0; i < 8; ++i) push(p, 1e5 + (i & 1) / 64.0, -1e5 + (i & 2) / 128.0, (i & 4) / 256.0);
  CovarianceOptions o;
  o.radius_m = 0.05F;
  o.regularisation = Regularisation::none;
  const Covariances C = covariances(context(), p.view(), o);
  for (std::size_t i = 0; i < p.size(); ++i) EXPECT_EQ(C.neighbours[i], 8);
}

TEST_P(CovarianceKernels, RefuseBadInput) {
  EXPECT_EQ(covariances(context(), Points{}.view(), {}).size(), 0U);
  Points p = randomCloud(1, 10, 1);
  const auto refuses = [&](auto change) {
    CovarianceOptions o;
    change(o);
    EXPECT_THROW((void)covariances(context(), p.view(), o), std::invalid_argument);
  };
  refuses([](auto& o) { o.radius_m = 0; });
  refuses([](auto& o) { o.rbf_gamma_per_m2 = -1; });
  refuses([](auto& o) { o.gaussian_sigma_m = std::nanf(""); });
  refuses([](auto& o) { o.laplacian_sigma_m = 0; });
  refuses([](auto& o) { o.polynomial_alpha_per_m2 = 0; });
  refuses([](auto& o) { o.polynomial_c = 0; });
  refuses([](auto& o) { o.polynomial_degree = 0; });
  refuses([](auto& o) { o.hist_s_m = std::numeric_limits<float>::infinity(); });
  refuses([](auto& o) { o.plane_epsilon = 0; });
  refuses([](auto& o) { o.plane_epsilon = 1.5F; });
  p.y[3] = std::nanf("");
  EXPECT_THROW((void)covariances(context(), p.view(), {}), std::invalid_argument);
}

TEST(Eigen3x3, AgreesWithTheCubic) {
  const Covariances C = randomCovariances(4, 200);
  for (std::size_t i = 0; i < C.size(); ++i) {
    const Matrix A = matrixAt(C, i);
    const Vector expected = eigenvalues(A);
    const auto e = eigen(Sym3<double>{A[0][0], A[0][1], A[0][2], A[1][1], A[1][2], A[2][2]});
    EXPECT_NEAR(e.low, expected[0], 1e-9);  // the cubic's own rounding
    EXPECT_NEAR(e.middle, expected[1], 1e-9);
    EXPECT_NEAR(e.high, expected[2], 1e-9);
    const Vector v{e.v_low.x, e.v_low.y, e.v_low.z}, Av = product(A, v);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(Av[k], e.low * v[k], 1e-12);
  }
}

}  // namespace
}  // namespace raceloc::gpu::test
