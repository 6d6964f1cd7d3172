#include <gtest/gtest.h>

#include "core/time_series.h"

namespace raceloc {
namespace {

TEST(TimeSeries, IsLinearBetweenSamplesAndHeldForAGap) {
  TimeSeries<double> series(10, 0.5);
  EXPECT_FALSE(series.at(0));
  EXPECT_TRUE(series.add(1, 10));
  EXPECT_TRUE(series.add(2, 20));
  EXPECT_DOUBLE_EQ(*series.at(1.25), 12.5);
  EXPECT_DOUBLE_EQ(*series.at(2), 20);
  EXPECT_DOUBLE_EQ(*series.at(0.6), 10);
  EXPECT_DOUBLE_EQ(*series.at(2.4), 20);
  EXPECT_FALSE(series.at(0.4));
  EXPECT_FALSE(series.at(2.6));
  EXPECT_DOUBLE_EQ(series.held_s(2.25), 0.25);
  EXPECT_EQ(series.held_s(1.5), 0);
}

TEST(TimeSeries, KnowsNothingInTheMiddleOfALongGap) {
  TimeSeries<double> series(10, 0.5);
  series.add(0, 1);
  series.add(3, 4);
  EXPECT_TRUE(series.at(0.4));
  EXPECT_FALSE(series.at(1.5));
  EXPECT_TRUE(series.at(2.6));
}

TEST(TimeSeries, TakesOnlyWhatIsNewAndForgetsWhatIsOld) {
  TimeSeries<double> series(2, 0.5);
  for (int i = 0; i <= 10; ++i) series.add(i, i);
  EXPECT_FALSE(series.add(10, 99));
  EXPECT_EQ(series.samples().size(), 3U);
  EXPECT_EQ(series.samples().front().stamp_s, 8);
  series.dropSince(9.5);
  EXPECT_EQ(series.samples().back().stamp_s, 9);
}

TEST(TimeSeries, TellsHowFarApartItsSamplesAre) {
  TimeSeries<double> series(10, 0.5);
  EXPECT_EQ(series.spacing_s(0), 0);
  series.add(0, 0);
  EXPECT_EQ(series.spacing_s(0), 0);
  series.add(1, 0);
  series.add(3, 0);
  EXPECT_EQ(series.spacing_s(0.5), 1);
  EXPECT_EQ(series.spacing_s(2), 2);
  EXPECT_EQ(series.spacing_s(-1), 1);
  EXPECT_EQ(series.spacing_s(9), 2);
}

}  // namespace
}  // namespace raceloc
