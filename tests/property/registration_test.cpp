#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "cloud/voxel_grid.h"
#include "registration/align.h"
#include "registration/search.h"
#include "support/room.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

struct Street {
  explicit Street(unsigned seed) : rnd(seed), target(context, GicpOptions{}.voxel_size_m) {
    const CovarianceCloud map =
        withCovariances(context, voxelGrid(context, test::street(rnd, 0.01), 0.25), {});
    target.insert(viewOf(map.cloud), map.covariances.view(), {});
  }
  /** Another sampling of the same street, seen from a car at T_map_body. */
  CovarianceCloud scanFrom(const Pose& T_map_body) {
    return withCovariances(
        context, voxelGrid(context, transformed(test::street(rnd, 0.01), T_map_body.inverse()), 0.5), {});
  }
  Random rnd;
  gpu::Context context{gpu::Backend::cpu};
  gpu::VoxelMap target;
};

TEST(AlignProperty, FindsTheCarFromADisturbedGuess) {
  forAll(10, [](Random& rnd) {
    Street street(static_cast<unsigned>(rnd.integer(1, 1'000'000)));
    const Pose T_map_body =
        poseFromRpy({rnd.uniform(-10, 10), rnd.uniform(-3, 3), 1}, 0.02, -0.02, rnd.uniform(-3, 3));
    const Registration r = align(street.context, street.scanFrom(T_map_body), street.target,
                                 T_map_body * rnd.pose(0.03, 0.3), {});
    EXPECT_TRUE(r.trusted({}));
    const Vector6d error = se3Log(T_map_body.inverse() * r.T_target_source);
    // Two samplings of 20000 points with 1 cm noise on surfaces cut into 1 m voxels: some cm, some mrad.
    EXPECT_LT(error.tail<3>().norm(), 0.05);
    EXPECT_LT(error.head<3>().norm(), 0.005);
  });
}

TEST(SearchProperty, FindsTheCarFromMetresAway) {
  forAll(3, [](Random& rnd) {
    Street street(static_cast<unsigned>(rnd.integer(1, 1'000'000)));
    const Pose T_map_body =
        poseFromRpy({rnd.uniform(-10, 10), rnd.uniform(-3, 3), 1}, 0, 0, rnd.uniform(-3, 3));
    const Eigen::Translation3d away_m(rnd.uniform(-3, 3), rnd.uniform(-12, 12),
                                      0);  // posts repeat every 7 m along x
    const Registration r = alignWithSearch(street.context, street.scanFrom(T_map_body), street.target,
                                           away_m * T_map_body, {}, {15});
    EXPECT_TRUE(r.trusted({}));
    EXPECT_LT((T_map_body.inverse() * r.T_target_source).translation().norm(), 0.05);  // as above
  });
}

TEST(Search, SaysWhenNothingFits) {
  Street street(5);
  const CovarianceCloud scan = street.scanFrom(Pose::Identity());
  const Registration r =
      alignWithSearch(street.context, scan, street.target, Pose(Eigen::Translation3d(500, 0, 0)), {}, {15});
  EXPECT_FALSE(r.trusted({}));
}

TEST(AlignProperty, IsNotFooledByAnotherPlace) {
  Street street(7);
  Random rnd(8);
  Cloud elsewhere;  // a ball of noise, as from a cloud of dust
  for (int i = 0; i < 5000; ++i) elsewhere.push((rnd.vectorWithin(1).normalized() * 30).cast<float>());
  const CovarianceCloud scan = withCovariances(street.context, voxelGrid(street.context, elsewhere, 0.5), {});
  EXPECT_FALSE(align(street.context, scan, street.target, Pose::Identity(), {}).trusted({}));
}

TEST(AlignProperty, CovarianceIsSymmetricPositiveAndAtLeastTheFloor) {
  Street street(3);
  const GicpOptions options;
  const Registration r =
      align(street.context, street.scanFrom(Pose::Identity()), street.target, Pose::Identity(), options);
  EXPECT_TRUE(r.covariance.isApprox(r.covariance.transpose(), 1e-12));
  EXPECT_GT(r.covariance.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0);
  const double floor_rad = options.min_sigma_deg * M_PI / 180;
  for (int axis = 0; axis < 3; ++axis) EXPECT_GE(r.covariance(axis, axis), floor_rad * floor_rad);
  for (int axis = 3; axis < 6; ++axis)
    EXPECT_GE(r.covariance(axis, axis), options.min_sigma_m * options.min_sigma_m);
}

TEST(AlignProperty, GicpFindsTheCarToo) {
  forAll(5, [](Random& rnd) {
    Street street(static_cast<unsigned>(rnd.integer(1, 1'000'000)));
    const CovarianceCloud map =
        withCovariances(street.context, voxelGrid(street.context, test::street(street.rnd, 0.01), 0.25), {});
    const gpu::NearestTarget points(viewOf(map.cloud), map.covariances.view());
    const Pose T_map_body =
        poseFromRpy({rnd.uniform(-10, 10), rnd.uniform(-3, 3), 1}, 0.02, -0.02, rnd.uniform(-3, 3));
    const Registration r =
        align(street.context, street.scanFrom(T_map_body), points, T_map_body * rnd.pose(0.03, 0.3), {});
    EXPECT_TRUE(r.trusted({}));
    const Vector6d error = se3Log(T_map_body.inverse() * r.T_target_source);
    EXPECT_LT(error.tail<3>().norm(), 0.05);  // as above
    EXPECT_LT(error.head<3>().norm(), 0.005);
  });
}

TEST(AlignProperty, SaysAlongWhichDirectionItKnowsLeast) {
  forAll(10, [](Random& rnd) {  // a tunnel: nothing tells where along it the car is
    Cloud tunnel;
    for (int i = 0; i < 20000; ++i) {
      const double along_m = rnd.uniform(-30, 30), angle_rad = rnd.uniform(-M_PI, M_PI);
      tunnel.push(Eigen::Vector3d(along_m, 5 * std::cos(angle_rad), 4 * std::sin(angle_rad)).cast<float>());
    }
    gpu::Context context(gpu::Backend::cpu);
    const CovarianceCloud map = withCovariances(context, voxelGrid(context, tunnel, 0.25), {});
    gpu::VoxelMap target(context, 1.0);
    target.insert(viewOf(map.cloud), map.covariances.view(), {});
    const double yaw_rad = rnd.uniform(-3, 3);
    const Pose T_map_body = poseFromRpy({0, 0, 0}, 0, 0, yaw_rad);
    const CovarianceCloud scan =
        withCovariances(context, voxelGrid(context, transformed(tunnel, T_map_body.inverse()), 0.5), {});
    const Registration r = align(context, scan, target, T_map_body, {});
    const Eigen::Vector3d along_body(std::cos(yaw_rad), -std::sin(yaw_rad), 0);
    EXPECT_GT(std::fabs(r.weakest_direction.dot(along_body)), 0.99);
    const Eigen::Vector3d variances_m2 = r.covariance.diagonal().tail<3>();
    EXPECT_GT(r.weakest_sigma_m * r.weakest_sigma_m, 1.5 * variances_m2.mean());
    EXPECT_TRUE((r.information * r.covariance).isIdentity(1e-6));
  });
}

TEST(Align, TooFewPointsAreAResult) {
  Street street(4);
  CovarianceCloud scan = street.scanFrom(Pose::Identity());
  const CovarianceCloud empty = withCovariances(street.context, Cloud{}, {});
  const Registration r = align(street.context, empty, street.target, Pose::Identity(), {});
  EXPECT_EQ(r.stop, gpu::Stop::too_few_inliers);
  EXPECT_FALSE(r.trusted({}));
  const gpu::VoxelMap nothing(street.context, 1.0);
  EXPECT_EQ(align(street.context, scan, nothing, Pose::Identity(), {}).stop, gpu::Stop::too_few_inliers);
}

}  // namespace
}  // namespace raceloc
