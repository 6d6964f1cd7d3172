#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>

#include "core/options.h"
#include "core/trajectory.h"
#include "core/types.h"
#include "support/forall.h"
#include "support/run_command.h"

namespace raceloc::test {
namespace {

using Matrix = Eigen::Matrix4d;

/** exp by 1024 small steps, each a Taylor series of four terms: shares no formula with the closed form. */
Matrix expBySmallSteps(const Vector6d& xi) {
  Matrix A;
  A << 0, -xi(2), xi(1), xi(3), xi(2), 0, -xi(0), xi(4), -xi(1), xi(0), 0, xi(5), 0, 0, 0, 0;
  A /= 1024;
  Matrix step = Matrix::Identity() + A + A * A / 2 + A * A * A / 6 + A * A * A * A / 24;
  for (int i = 0; i < 10; ++i) step = (step * step).eval();
  return step;
}

Vector6d tangent(Random& rnd, double angle_rad) {
  Vector6d xi;
  xi << rnd.vectorWithin(1).normalized() * angle_rad, rnd.vectorWithin(100);
  return xi;
}

/** From none over the switch between series and closed form to nearly half a turn. */
double anyAngle(Random& rnd) {
  return rnd.oneOf({0.0, 1e-12, 1e-7, 0.99e-5, 1.01e-5, 1e-3, rnd.uniform(0, 3), 3.1415});
}

TEST(Se3Property, ExpIsTheLimitOfSmallSteps) {
  forAll(200, [](Random& rnd) {
    const Vector6d xi = tangent(rnd, anyAngle(rnd));
    // 100 m, and 1e-11 of it: ten squarings, and 1 - cos of small angles
    EXPECT_LT((se3Exp(xi).matrix() - expBySmallSteps(xi)).cwiseAbs().maxCoeff(), 1e-8) << xi.transpose();
  });
}

TEST(Se3Property, LogUndoesExp) {
  forAll(200, [](Random& rnd) {
    const Vector6d xi = tangent(rnd, anyAngle(rnd));
    EXPECT_LT((se3Log(se3Exp(xi)) - xi).cwiseAbs().maxCoeff(), 1e-8) << xi.transpose();  // as above
  });
}

TEST(Se3Property, ExpUndoesLogEvenAtHalfATurn) {
  forAll(200, [](Random& rnd) {
    const Pose T = se3Exp(tangent(rnd, rnd.oneOf({M_PI, M_PI - 1e-9, rnd.uniform(0, M_PI)})));
    const Vector6d xi = se3Log(T);
    EXPECT_LE(xi.head<3>().norm(), M_PI + 1e-12);
    EXPECT_LT((se3Exp(xi).matrix() - T.matrix()).cwiseAbs().maxCoeff(),
              1e-6);  // axis to 1e-8 near pi, 100 m away
  });
}

TEST(Se3Property, StepsAlongOneScrewAddUp) {
  forAll(200, [](Random& rnd) {
    const Vector6d xi = tangent(rnd, rnd.uniform(0, 1));
    const double s = rnd.uniform(-1, 1);
    EXPECT_TRUE((se3Exp(s * xi) * se3Exp((1 - s) * xi)).isApprox(se3Exp(xi), 1e-9));
    EXPECT_TRUE((se3Exp(xi) * se3Exp(-xi)).isApprox(Pose::Identity(), 1e-9));
  });
}

TEST(AngleProperty, WrappedAngleIsTheSameDirectionInRange) {
  forAll(500, [](Random& rnd) {
    const double edge = rnd.oneOf({M_PI, -M_PI, 0.0, 3 * M_PI});
    const double angle_rad =
        rnd.oneOf({rnd.uniform(-100, 100), edge, std::nextafter(edge, 100), std::nextafter(edge, -100)});
    const double wrapped_rad = wrapAngle(angle_rad);
    EXPECT_GE(wrapped_rad, -M_PI) << angle_rad;
    EXPECT_LT(wrapped_rad, M_PI) << angle_rad;
    EXPECT_NEAR(std::cos(wrapped_rad), std::cos(angle_rad), 1e-13);  // double at 100 rad
    EXPECT_NEAR(std::sin(wrapped_rad), std::sin(angle_rad), 1e-13);
  });
}

TEST(PoseProperty, RollPitchYawTurnAboutFixedAxesInThatOrder) {
  forAll(200, [](Random& rnd) {
    const double roll = rnd.uniform(-3, 3);
    const double pitch = rnd.uniform(-1.5, 1.5);
    const double yaw = rnd.uniform(-3, 3);
    Eigen::Vector3d p = rnd.vectorWithin(10);
    const Eigen::Vector3d rotated = poseFromRpy({0, 0, 0}, roll, pitch, yaw) * p;
    p = Eigen::Vector3d(p.x(), p.y() * std::cos(roll) - p.z() * std::sin(roll),
                        p.y() * std::sin(roll) + p.z() * std::cos(roll));
    p = Eigen::Vector3d(p.x() * std::cos(pitch) + p.z() * std::sin(pitch), p.y(),
                        p.z() * std::cos(pitch) - p.x() * std::sin(pitch));
    p = Eigen::Vector3d(p.x() * std::cos(yaw) - p.y() * std::sin(yaw),
                        p.x() * std::sin(yaw) + p.y() * std::cos(yaw), p.z());
    EXPECT_LT((rotated - p).norm(), 1e-12);
    EXPECT_NEAR(yawOf(poseFromRpy({0, 0, 0}, roll, pitch, yaw)), yaw, 1e-12);
  });
}

TEST(TumProperty, SurvivesTheFile) {
  const TemporaryFolder folder;
  forAll(50, [&](Random& rnd) {
    Trajectory written;
    if (rnd.integer(0, 1) == 1)
      written.origin = GeodeticPoint{rnd.uniform(-90, 90), rnd.uniform(-180, 180), rnd.uniform(-100, 4000)};
    double stamp_s = 1.6e9;
    const int poses = rnd.integer(1, 20);
    for (int i = 0; i < poses; ++i)
      written.poses.push_back({stamp_s += rnd.uniform(1e-5, 1), rnd.pose(M_PI, 1e4)});
    writeTum(folder / "race.tum", written);
    const Trajectory read = readTum(folder / "race.tum");

    ASSERT_EQ(read.origin.has_value(), written.origin.has_value());
    if (read.origin) {
      EXPECT_NEAR(read.origin->latitude_deg, written.origin->latitude_deg, 1e-10);
      EXPECT_NEAR(read.origin->longitude_deg, written.origin->longitude_deg, 1e-10);
      EXPECT_NEAR(read.origin->height_m, written.origin->height_m, 1e-4);
    }
    ASSERT_EQ(read.poses.size(), written.poses.size());
    for (std::size_t i = 0; i < read.poses.size(); ++i) {
      const Pose error = written.poses[i].T_map_body.inverse() * read.poses[i].T_map_body;
      EXPECT_NEAR(read.poses[i].stamp_s, written.poses[i].stamp_s, 1e-6);
      EXPECT_LT(error.translation().norm(), 1e-4);                 // three times half of 0.1 mm, squared
      EXPECT_LT(Eigen::AngleAxisd(error.linear()).angle(), 1e-8);  // four numbers of nine digits
    }
  });
}

TEST(TumProperty, WritesTheSameBytesAgainAfterReading) {
  const TemporaryFolder folder;
  const auto textOf = [](const std::string& path) {
    std::ifstream in(path);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  forAll(50, [&](Random& rnd) {
    Trajectory first;
    for (int i = 0; i < 10; ++i) first.poses.push_back({1e9 + i, rnd.pose(1, 1e4)});
    writeTum(folder / "first.tum", first);
    Trajectory read = readTum(folder / "first.tum");
    for (auto& pose : read.poses)
      pose.T_map_body.linear().setIdentity();  // its last digit may round the other way
    writeTum(folder / "second.tum", read);
    const Trajectory again = readTum(folder / "second.tum");
    for (std::size_t i = 0; i < again.poses.size(); ++i) {
      EXPECT_EQ(again.poses[i].stamp_s, read.poses[i].stamp_s);
      EXPECT_EQ(again.poses[i].T_map_body.translation(), read.poses[i].T_map_body.translation());
    }
    writeTum(folder / "third.tum", again);
    EXPECT_EQ(textOf(folder / "second.tum"), textOf(folder / "third.tum"));
  });
}

struct AnyOptions {
  double length_m = 1;
  int count = 1;
  bool flag = false;
  std::string name = "none";
  void describe(OptionList& keys) {
    keys.add("length_m", length_m, above(-1e9), "a length [m]");
    keys.add("count", count, atLeast(-1e6), "a count");
    keys.add("flag", flag, "a flag");
    keys.add("name", name, "a name");
  }
};

TEST(OptionsProperty, WrittenTextReadsBackToTheSameBits) {
  const TemporaryFolder folder;
  forAll(100, [&](Random& rnd) {
    AnyOptions options;
    options.length_m = rnd.oneOf({0.0, -0.1, 1e-300, 1e300, rnd.normal(1e3), rnd.normal(1e-6)});
    options.count = rnd.integer(-1000, 1000);
    options.flag = rnd.integer(0, 1) == 1;
    options.name = rnd.oneOf({"gps_left", "two words", ""});
    std::ofstream(folder / "any.ini") << iniText("any", options);
    IniFile ini(folder / "any.ini");
    AnyOptions read;
    ini.load("any", read);
    ini.rejectUnknownSections();
    EXPECT_EQ(read.length_m, options.length_m);
    EXPECT_EQ(read.count, options.count);
    EXPECT_EQ(read.flag, options.flag);
    EXPECT_EQ(read.name, options.name);
  });
}

}  // namespace
}  // namespace raceloc::test
