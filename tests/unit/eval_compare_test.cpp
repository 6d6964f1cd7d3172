#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "eval/compare.h"
#include "eval/report.h"
#include "support/complaint.h"
#include "support/files.h"
#include "support/run_command.h"
#include "support/trajectories.h"

namespace raceloc::test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/** Errors at 10 Hz on a straight; `error` of time [s] in the plane, lateral; the other directions are good. */
template <class Error>
ErrorSeries series(const std::string& path, double duration_s, Error error) {
  ErrorSeries run;
  run.path = path;
  for (int i = 0; i <= static_cast<int>(10 * duration_s); ++i) {
    const double t_s = 0.1 * i;
    run.stamp_s.push_back(t_s);
    run.truth_x_m.push_back(10 * t_s);
    run.truth_y_m.push_back(0);
    for (std::size_t k = 0; k < kCompared.size(); ++k) run.errors[k].push_back(k < 2 ? error(t_s) : 0);
  }
  return run;
}

double flat(double) { return 0.1; }

/** Noise that remembers for about two seconds, of 0.1 m. */
ErrorSeries noise(const std::string& path, double duration_s, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  double value = 0;
  return series(path, duration_s, [&](double) {
    value = 0.95 * value + 0.1 * std::sqrt(1 - 0.95 * 0.95) * normal(random);
    return value;
  });
}

TEST(Compare, RmseAndDifferenceByHand) {
  // A: 0.1 m all the time. B: 0.3 m in every second block of 10 s, else 0.1 m: mean square (0.09 + 0.01) / 2.
  const auto steps = [](double t_s) { return static_cast<int>(t_s / 10) % 2 == 0 ? 0.1 : 0.3; };
  const Comparison c = compare(series("a", 99.9, flat), series("b", 99.9, steps), {});
  EXPECT_EQ(c.blocks, 9U);  // 99.9 s: nine blocks of 11.1 s
  CompareOptions options;
  options.block_s = 9.99;
  const Comparison ten = compare(series("a", 99.9, flat), series("b", 99.9, steps), options);
  ASSERT_EQ(ten.blocks, 10U);
  EXPECT_NEAR(ten.differences[0].a_rmse, 0.1, 1e-12);
  EXPECT_NEAR(ten.differences[0].b_rmse, std::sqrt(0.05), 2e-3);  // a pose in 100 falls into the next block
  ASSERT_TRUE(ten.differences[0].significance);
  // Five blocks of ten differ, all one way: all of them swapped or none is as large, 2 of 32.
  EXPECT_NEAR(ten.differences[0].significance->p, 2.0 / 32, 0.01);
  // Of ten blocks that are drawn, two to eight are of 0.3 m in 95 % of the draws, B(10, 1/2), and the others of 0.1 m.
  EXPECT_NEAR(ten.differences[0].significance->low, 0.1 - std::sqrt((8 * 0.09 + 2 * 0.01) / 10), 2e-3);
  EXPECT_NEAR(ten.differences[0].significance->high, 0.1 - std::sqrt((2 * 0.09 + 8 * 0.01) / 10), 2e-3);
}

TEST(Compare, TruthsAreLookedUpBetweenStamps) {
  const auto zero = [](double) { return 0.0; };
  ErrorSeries shifted = series("b", 100, zero);
  for (double& stamp_s : shifted.stamp_s)
    stamp_s += 0.03;  // other instants of another drive, 0.3 m behind on the same straight
  EXPECT_THAT(complaint([&] { (void)compare(series("a", 100, zero), shifted, {}); }),
              HasSubstr("0.30 m apart"));
  for (double& x_m : shifted.truth_x_m) x_m += 0.3;  // of this drive
  EXPECT_THAT(compare(series("a", 100, zero), shifted, {}).warnings, IsEmpty());

  ErrorSeries sparse = series("b", 100, zero);
  for (std::size_t i = 0; i < sparse.stamp_s.size(); ++i) sparse.stamp_s[i] *= 2;
  EXPECT_THAT(compare(series("a", 100, zero), sparse, {}).warnings, Contains(HasSubstr("is not known")));
}

TEST(Compare, OfFarTooManyDrawsIsRefused) {
  CompareOptions options;
  options.block_s = 0.01;
  options.resamples = 1000000;
  const auto zero = [](double) { return 0.0; };
  EXPECT_THAT(complaint([&] { (void)compare(series("a", 100, zero), series("b", 100, zero), options); }),
              AllOf(HasSubstr("--block"), HasSubstr("--resamples")));
}

TEST(Compare, OfOneRunWithItselfIsChance) {
  const Comparison c = compare(noise("a", 200, 1), noise("a", 200, 1), {});
  for (const Difference& d : c.differences) {
    ASSERT_TRUE(d.significance);
    EXPECT_EQ(d.significance->p, 1);
    EXPECT_EQ(d.significance->low, 0);
    EXPECT_EQ(d.significance->high, 0);
  }
}

TEST(Compare, OfTwoRunsOfOneKindIsSeldomSignificant) {
  CompareOptions options;
  options.resamples = 500;
  int significant = 0, covered = 0;
  constexpr int kTries = 200;
  for (unsigned i = 0; i < kTries; ++i) {
    const Comparison c = compare(noise("a", 300, 2 * i), noise("b", 300, 2 * i + 1), options);
    significant += c.differences[0].significance->p <= 0.05 ? 1 : 0;
    covered += c.differences[0].significance->low <= 0 && c.differences[0].significance->high >= 0 ? 1 : 0;
  }
  EXPECT_LE(significant, 20);  // 5 % of 200 are 10, +3 sigma
  EXPECT_GE(significant, 1);   // a test that never fires tells nothing
  EXPECT_GE(covered, 170);     // 95 % of 200 are 190; percentiles of 30 blocks are a little narrow
}

TEST(Compare, SeesADifferenceThatIsThere) {
  auto twice = noise("b", 300, 8);
  for (auto& errors : twice.errors)
    for (double& error : errors) error *= 2;
  const Comparison c = compare(noise("a", 300, 7), twice, {});
  EXPECT_LT(c.differences[0].significance->p, 0.001);
  EXPECT_LT(c.differences[0].significance->high, 0);
  EXPECT_THAT(textTable(tableOf(c, "A and B")), HasSubstr("A is better"));
}

TEST(Compare, IsTheSameEachTimeAndTurnsWithItsSides) {
  const auto a = noise("a", 200, 3), b = noise("b", 200, 4);
  const Comparison once = compare(a, b, {}), again = compare(a, b, {}), turned = compare(b, a, {});
  EXPECT_EQ(textTable(tableOf(once, "")), textTable(tableOf(again, "")));
  EXPECT_EQ(once.differences[0].a_rmse, turned.differences[0].b_rmse);
  EXPECT_EQ(once.differences[0].significance->p, turned.differences[0].significance->p);
}

TEST(Compare, TooFewBlocksGiveNoProbability) {
  const Comparison c = compare(noise("a", 60, 1), noise("b", 60, 2), {});
  EXPECT_EQ(c.blocks, 6U);
  EXPECT_FALSE(c.differences[0].significance);
  EXPECT_THAT(c.warnings, SizeIs(1));
  EXPECT_THAT(c.warnings[0], HasSubstr("6 blocks"));
}

TEST(Compare, BlocksThatAreTooShortAreToldOf) {
  CompareOptions options;
  options.block_s = 0.3;
  const Comparison c = compare(noise("a", 200, 1), noise("b", 200, 2), options);
  ASSERT_THAT(c.warnings, SizeIs(1));
  EXPECT_THAT(c.warnings[0], HasSubstr("correlate"));
  EXPECT_THAT(compare(noise("a", 400, 1), noise("b", 400, 2), {}).warnings, IsEmpty());
}

TEST(Compare, RunsOfOtherDrivesAreRefused) {
  auto late = series("late.csv", 20, flat), elsewhere = series("elsewhere.csv", 20, flat);
  for (double& stamp_s : late.stamp_s) stamp_s += 1000;
  for (double& y_m : elsewhere.truth_y_m) y_m += 0.5;
  const auto a = series("a.csv", 20, flat);
  EXPECT_THAT(complaint([&] { (void)compare(a, late, {}); }),
              AllOf(HasSubstr("a.csv 0.000 .. 20.000 s"), HasSubstr("late.csv 1000.000"),
                    HasSubstr("no time in common")));
  EXPECT_THAT(complaint([&] { (void)compare(a, elsewhere, {}); }),
              AllOf(HasSubstr("elsewhere.csv"), HasSubstr("0.50 m apart")));
}

TEST(Compare, ReadsWhatTheEvaluationWrites) {
  const TemporaryFolder folder;
  const auto left = moved(straight("e"), poseFromRpy({0, 0.25, 0}, 0, 0, 0));
  writeFile(folder / "e.csv", errorsCsv(evaluate(straight("t"), left, {})));
  EXPECT_TRUE(isErrorsFile(folder / "e.csv"));
  const ErrorSeries run = readErrors(folder / "e.csv");
  EXPECT_THAT(run.stamp_s, SizeIs(101));
  EXPECT_NEAR(run.errors[1][50], 0.25, 1e-4);  // written to 0.1 mm
  EXPECT_NEAR(run.truth_x_m[50], 50, 1e-4);
}

}  // namespace
}  // namespace raceloc::test
