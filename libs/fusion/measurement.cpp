#include "fusion/measurement.h"

#include "core/types.h"

namespace raceloc {

Eigen::Matrix<double, 3, 4> observationMatrix(HeadingKind heading) {
  Eigen::Matrix<double, 3, 4> H = Eigen::Matrix<double, 3, 4>::Zero();
  H(0, 0) = H(1, 1) = 1;
  if (heading != HeadingKind::none) H(2, 2) = 1;
  if (heading == HeadingKind::course) H(2, 3) = 1;
  return H;
}

Eigen::Vector3d readingOf(const PoseFix& fix) {
  return {fix.p_map_m.x(), fix.p_map_m.y(), fix.heading == HeadingKind::none ? 0.0 : fix.heading_rad};
}

Eigen::Matrix3d noiseOf(const PoseFix& fix) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
  R.topLeftCorner<2, 2>() = fix.cov_p_m2;
  R(2, 2) = fix.heading == HeadingKind::none ? 1.0 : fix.heading_sigma_rad * fix.heading_sigma_rad;
  return R;
}

Eigen::Vector3d innovation(const Eigen::Vector3d& reading, const Eigen::Vector3d& predicted) {
  Eigen::Vector3d nu = reading - predicted;
  nu(2) = wrapAngle(nu(2));
  return nu;
}

}  // namespace raceloc
