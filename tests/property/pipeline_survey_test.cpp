#include <gtest/gtest.h>

#include "pipeline/survey.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

std::string word(Random& rnd) {
  std::string text(static_cast<std::size_t>(rnd.oneOf({0, 1, 30})), ' ');
  for (char& letter : text) letter = static_cast<char>(rnd.integer(-128, 127));
  return text;
}

std::size_t count(Random& rnd) { return static_cast<std::size_t>(rnd.integer(0, 1'000'000)); }
bool coin(Random& rnd) { return rnd.oneOf({true, false}); }

template <class Matrix>
Matrix matrix(Random& rnd) {  // stored, not judged: it need be no covariance
  return Matrix::NullaryExpr([&] { return rnd.normal(); });
}

BodyMotion motion(Random& rnd) { return {rnd.uniform(0, 1), rnd.pose(3, 10), matrix<Matrix6d>(rnd)}; }

Survey randomSurvey(Random& rnd) {
  Survey survey{};
  survey.session = word(rnd);
  if (coin(rnd)) survey.origin = GeodeticPoint{rnd.uniform(-90, 90), rnd.uniform(-180, 180), rnd.normal(100)};
  survey.recorded_s = rnd.uniform(0, 1e4);
  survey.p_body_eyes_m = rnd.vectorWithin(2);
  for (int left = rnd.oneOf({0, 1, 6}); left > 0; --left) {
    Keyframe& k =
        survey.keyframes.emplace_back(Keyframe{1.7e9 + rnd.normal(), rnd.pose(3, 500), motion(rnd)});
    if (coin(rnd)) k.reckoned = motion(rnd);
    for (int fixes = rnd.integer(0, 3); fixes > 0; --fixes)
      k.gps.push_back({word(rnd), rnd.vectorWithin(500), matrix<Eigen::Matrix3d>(rnd), rnd.vectorWithin(2)});
    for (int attitudes = rnd.integer(0, 2); attitudes > 0; --attitudes)
      k.attitudes.push_back({rnd.pose(3, 1).linear(), matrix<Eigen::Matrix3d>(rnd)});
    if (coin(rnd)) k.level = KeyLevel{rnd.vectorWithin(1).normalized(), rnd.uniform(0, 1)};
  }
  for (int left = rnd.oneOf({0, 1, 10}); left > 0; --left)
    survey.odometry.poses.push_back({1.7e9 + rnd.normal(), rnd.pose(3, 500)});
  survey.tally = {count(rnd), count(rnd), count(rnd), count(rnd), rnd.uniform(0, 1e4), {}};
  for (int faults = rnd.integer(0, 3); faults > 0; --faults) survey.tally.faults[word(rnd)] = count(rnd);
  survey.match_residual_m = rnd.uniform(0, 1);
  survey.match_inlier_share = rnd.uniform(0, 1);
  survey.dropped_late = count(rnd);
  survey.device_reason = word(rnd);
  return survey;
}

void expectSame(const BodyMotion& a, const BodyMotion& b) {
  EXPECT_EQ(a.duration_s, b.duration_s);
  EXPECT_EQ(a.T_start_end.matrix(), b.T_start_end.matrix());
  EXPECT_EQ(a.covariance, b.covariance);
}

void expectSame(const Keyframe& a, const Keyframe& b) {
  EXPECT_EQ(a.stamp_s, b.stamp_s);
  EXPECT_EQ(a.T_odom_body.matrix(), b.T_odom_body.matrix());
  expectSame(a.since_last, b.since_last);
  ASSERT_EQ(a.reckoned.has_value(), b.reckoned.has_value());
  if (a.reckoned) expectSame(*a.reckoned, *b.reckoned);
  ASSERT_EQ(a.gps.size(), b.gps.size());
  for (std::size_t i = 0; i < a.gps.size(); ++i) {
    EXPECT_EQ(a.gps[i].receiver, b.gps[i].receiver);
    EXPECT_EQ(a.gps[i].p_map_antenna_m, b.gps[i].p_map_antenna_m);
    EXPECT_EQ(a.gps[i].cov_map_m2, b.gps[i].cov_map_m2);
    EXPECT_EQ(a.gps[i].p_body_antenna_m, b.gps[i].p_body_antenna_m);
    EXPECT_EQ(a.gps[i].refused, b.gps[i].refused);
  }
  ASSERT_EQ(a.attitudes.size(), b.attitudes.size());
  for (std::size_t i = 0; i < a.attitudes.size(); ++i) {
    EXPECT_EQ(a.attitudes[i].R_map_body, b.attitudes[i].R_map_body);
    EXPECT_EQ(a.attitudes[i].covariance_rad2, b.attitudes[i].covariance_rad2);
  }
  ASSERT_EQ(a.level.has_value(), b.level.has_value());
  if (a.level) {
    EXPECT_EQ(a.level->up_body, b.level->up_body);
    EXPECT_EQ(a.level->sigma_rad, b.level->sigma_rad);
  }
}

void expectSame(const Survey& a, const Survey& b) {
  EXPECT_EQ(a.session, b.session);
  ASSERT_EQ(a.origin.has_value(), b.origin.has_value());
  if (a.origin) {
    EXPECT_EQ(a.origin->latitude_deg, b.origin->latitude_deg);
    EXPECT_EQ(a.origin->longitude_deg, b.origin->longitude_deg);
    EXPECT_EQ(a.origin->height_m, b.origin->height_m);
  }
  EXPECT_EQ(a.recorded_s, b.recorded_s);
  EXPECT_EQ(a.p_body_eyes_m, b.p_body_eyes_m);
  ASSERT_EQ(a.keyframes.size(), b.keyframes.size());
  for (std::size_t i = 0; i < a.keyframes.size(); ++i) expectSame(a.keyframes[i], b.keyframes[i]);
  ASSERT_EQ(a.odometry.poses.size(), b.odometry.poses.size());
  for (std::size_t i = 0; i < a.odometry.poses.size(); ++i) {
    EXPECT_EQ(a.odometry.poses[i].stamp_s, b.odometry.poses[i].stamp_s);
    EXPECT_EQ(a.odometry.poses[i].T_map_body.matrix(), b.odometry.poses[i].T_map_body.matrix());
  }
  EXPECT_EQ(a.tally.scans, b.tally.scans);
  EXPECT_EQ(a.tally.trusted, b.tally.trusted);
  EXPECT_EQ(a.tally.restarts, b.tally.restarts);
  EXPECT_EQ(a.tally.by_wheels, b.tally.by_wheels);
  EXPECT_EQ(a.tally.length_m, b.tally.length_m);
  EXPECT_EQ(a.tally.faults, b.tally.faults);
  EXPECT_EQ(a.match_residual_m, b.match_residual_m);
  EXPECT_EQ(a.match_inlier_share, b.match_inlier_share);
  EXPECT_EQ(a.dropped_late, b.dropped_late);
  EXPECT_EQ(a.device_reason, b.device_reason);
}

Cloud randomCloud(Random& rnd) {
  Cloud cloud;
  const bool intensities = coin(rnd);
  for (int left = rnd.oneOf({0, 1, 500}); left > 0; --left) {
    const Eigen::Vector3f p = rnd.vectorWithin(100).cast<float>();
    if (intensities)
      cloud.push(p, static_cast<float>(rnd.uniform(0, 1)));
    else
      cloud.push(p);
  }
  return cloud;
}

/** Reading any part of the bytes from their begin throws. */
template <class Read>
void expectThrowsWhereverCut(Random& rnd, const Bytes& bytes, const Read& read) {
  std::vector<int> lengths{0, static_cast<int>(bytes.size()) - 1};
  for (int k = 0; k < 100; ++k) lengths.push_back(rnd.integer(0, static_cast<int>(bytes.size()) - 1));
  for (const int length : lengths)
    EXPECT_THROW((void)read(Bytes(bytes.begin(), bytes.begin() + length)), std::out_of_range) << length;
}

TEST(SurveyBytesProperty, ReadBackAreTheSurvey) {
  forAll(100, [](Random& rnd) {
    const Survey survey = randomSurvey(rnd);
    const Bytes bytes = toBytes(survey);
    const Survey back = surveyFrom(bytes);
    expectSame(back, survey);
    EXPECT_EQ(toBytes(back), bytes);
  });
}

TEST(SurveyBytesProperty, CutOffAtAnyLengthAreRefused) {
  forAll(30, [](Random& rnd) { expectThrowsWhereverCut(rnd, toBytes(randomSurvey(rnd)), surveyFrom); });
}

TEST(CloudBytesProperty, ReadBackAreTheCloud) {
  forAll(100, [](Random& rnd) {
    const Cloud cloud = randomCloud(rnd), back = cloudFrom(toBytes(cloud));
    EXPECT_EQ(back.x, cloud.x);
    EXPECT_EQ(back.y, cloud.y);
    EXPECT_EQ(back.z, cloud.z);
    EXPECT_EQ(back.intensity, cloud.intensity);
  });
}

TEST(CloudBytesProperty, CutOffAtAnyLengthAreRefused) {
  forAll(30, [](Random& rnd) { expectThrowsWhereverCut(rnd, toBytes(randomCloud(rnd)), cloudFrom); });
}

}  // namespace
}  // namespace raceloc
