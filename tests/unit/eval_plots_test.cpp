#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "eval/plots.h"
#include "eval/report.h"
#include "eval/time_picture.h"
#include "support/complaint.h"
#include "support/trajectories.h"

namespace raceloc::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(Report, PageIsWholeAndLinksToNowhere) {
  const auto strange = straight("a & <b>.tum");
  const std::string page =
      htmlReport(evaluate(straight("truth.tum"), strange, {}), {}, "raceloc-eval --truth 'x'");
  EXPECT_THAT(page, AllOf(HasSubstr("</html>"), HasSubstr("a &amp; &lt;b&gt;.tum"), Not(HasSubstr("<b>")),
                          HasSubstr("raceloc-eval --truth 'x'"), Not(HasSubstr("<?xml"))));
  EXPECT_THAT(page, AllOf(Not(HasSubstr("<link")), Not(HasSubstr("src=")), Not(HasSubstr("href=\"http")),
                          Not(HasSubstr("url(http")), Not(HasSubstr("@import"))));
  std::size_t pictures = 0;
  for (std::size_t at = 0; (at = page.find("<svg", at)) != std::string::npos; ++at) ++pictures;
  EXPECT_EQ(pictures, 9U);
}

TEST(Plots, AreTheSameBytesEachTime) {
  const Evaluation e = evaluate(straight("truth"), straight("estimate"), {});
  for (const Picture& picture : picturesOf(e, {}))
    for (const auto format : {PictureFormat::svg, PictureFormat::page, PictureFormat::png})
      EXPECT_TRUE(drawn(picture, format) == drawn(picture, format)) << picture.name;
}

TEST(Plots, OfOnePoseAreDrawn) {
  const Evaluation one = evaluate(file("t", {onStraight(0)}), file("e", {onStraight(0)}), {});
  for (const Picture& picture : picturesOf(one, {}))
    EXPECT_THAT(drawn(picture, PictureFormat::svg), HasSubstr("</svg>")) << picture.name;
}

TEST(Plots, OfAnHourHaveNoMorePointsThanAScreen) {
  const auto at_10_hz = [](double t_s) { return onCircle(t_s); };
  const Evaluation hour =
      evaluate(sampled("t", 0, 3600, 0.1, at_10_hz), sampled("e", 0, 3600, 0.1, at_10_hz), {});
  EXPECT_EQ(hour.by_lap.size(), 115U);  // a lap takes 10 pi s
  for (const Picture& picture : picturesOf(hour, {}))
    EXPECT_LT(drawn(picture, PictureFormat::svg).size(), 1000000U) << picture.name;  // 36 000 poses
}

TEST(Plots, ArePngByTheirName) {
  const Evaluation e = evaluate(straight("truth"), straight("estimate"), {});
  EXPECT_EQ(drawn(trajectoryPicture(e), formatOf("a.png")).substr(1, 3), "PNG");
  EXPECT_THAT(drawn(trajectoryPicture(e), formatOf("a.svg")), HasSubstr("<svg"));
  EXPECT_THAT(complaint([] { (void)formatOf("a.jpg"); }), AllOf(HasSubstr("a.jpg"), HasSubstr(".png")));
}

TEST(Plots, OverTimeBreakWhereThereIsNoValue) {
  const auto picture = [](double middle) {
    const TimeCurve curve{"a", {0, 1, 2, 3, 4}, {1, 2, middle, 3, 1}};
    return timePicture(
        {{"above [m]", {curve}, {{0.5, "limit"}}}, {"below [m]", {curve, {"b", {0, 4}, {0, 1}}}, {}}},
        {{1, 2, "dark"}, {3, 4, "dark"}});
  };
  const std::string whole = picture(2), broken = picture(std::nan(""));
  EXPECT_EQ(whole, picture(2));
  for (const std::string text : {"above [m]", "below [m]", "limit", ">dark<"})
    EXPECT_THAT(whole, HasSubstr(text));
  const auto pen_downs = [](const std::string& svg) { return std::count(svg.begin(), svg.end(), 'M'); };
  EXPECT_EQ(pen_downs(broken), pen_downs(whole) + 2);  // each panel's curve begins once more
}

TEST(Plots, WithoutGnuplotSayWhatToInstall) {
  const Evaluation e = evaluate(straight("truth"), straight("estimate"), {});
  const char* path = std::getenv("PATH");
  const std::string saved = path != nullptr ? path : "";
  setenv("PATH", "/nonexistent", 1);
  const std::string message = complaint([&] { (void)drawn(trajectoryPicture(e), PictureFormat::svg); });
  setenv("PATH", saved.c_str(), 1);
  EXPECT_THAT(message, HasSubstr("install gnuplot-nox"));
}

}  // namespace
}  // namespace raceloc::test
