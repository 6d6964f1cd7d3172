#include "map/map_rules.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

#include "map/map_tables.h"

namespace raceloc {

namespace {

template <class Matrix>
bool isPositive(const Matrix& matrix) {  // semidefinite, up to rounding
  const double scale = matrix.cwiseAbs().maxCoeff();
  return (matrix - matrix.transpose()).cwiseAbs().maxCoeff() <= 1e-6 * scale &&
         Eigen::SelfAdjointEigenSolver<Matrix>(matrix, Eigen::EigenvaluesOnly).eigenvalues()(0) >=
             -1e-6 * scale;
}
bool isRigid(const Pose& T) {
  const Eigen::Matrix3d R = T.linear();
  return (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-6 &&
         R.determinant() > 0;
}

/** Whether all numbers in a row are finite: in its cells, where every one of them is. */
template <class Row>
bool isFinite(const Row& row) {
  for (const SqlValue& cell : cellsOf(row)) {
    if (const auto* number = std::get_if<double>(&cell); number != nullptr && !std::isfinite(*number))
      return false;
    if (const auto* bytes = std::get_if<Bytes>(&cell); bytes != nullptr)
      for (const double value : ByteReader(*bytes).numbers<double>(bytes->size() / sizeof(double)))
        if (!std::isfinite(value)) return false;
  }
  return true;
}
template <class Row>
std::string notFinite(const std::vector<Row>& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (!isFinite(rows[i]))
      return std::string(SqlTable<Row>::kName) + " row " + std::to_string(i) +
             " has a number that is not finite";
  return "";
}

}  // namespace

std::string faultOf(const MapContent& content) {
  const MapInfo& info = content.info;
  for (const std::string& fault :
       {notFinite(std::vector{rowOf(info)}), notFinite(content.key_poses), notFinite(content.waypoints),
        notFinite(content.edges), notFinite(content.fixes), notFinite(content.road),
        notFinite(content.walls)})
    if (!fault.empty()) return fault;
  if (!content.waypoints.empty() && !(info.waypoint_spacing_m > 0))
    return "the way-points have no spacing > 0";
  const auto hasKey = [&](std::int32_t key) {
    return key >= 0 && static_cast<std::size_t>(key) < content.key_poses.size();
  };

  for (std::size_t i = 0; i < content.key_poses.size(); ++i) {
    const KeyPose& k = content.key_poses[i];
    const std::string name = "key pose " + std::to_string(i);
    if (!isRigid(k.T_map_body) || (k.T_map_body_gps && !isRigid(*k.T_map_body_gps)) ||
        (k.T_map_body_lidar && !isRigid(*k.T_map_body_lidar)))
      return name + " has a pose that is not rigid";
    if (std::find(info.sessions.begin(), info.sessions.end(), k.session) == info.sessions.end())
      return name + " is of session " + k.session + ", which is not listed";
    if (k.racetrack_id &&
        (*k.racetrack_id < 0 || static_cast<std::size_t>(*k.racetrack_id) >= content.waypoints.size()))
      return name + " has racetrack ID " + std::to_string(*k.racetrack_id) + ", but there are " +
             std::to_string(content.waypoints.size()) + " way-points";
  }
  for (std::size_t i = 0; i < content.edges.size(); ++i) {
    const MapEdge& e = content.edges[i];
    const std::string name = "edge " + std::to_string(i);
    if (!hasKey(e.i) || !hasKey(e.j) || e.i == e.j) return name + " does not tie two key poses";
    if (!isRigid(e.T_i_j)) return name + " has a pose that is not rigid";
    if (!isPositive(e.information)) return name + " has no positive information";
    if (e.kind != EdgeKind::odometry && e.kind != EdgeKind::loop) return name + " is of an unknown kind";
  }
  for (std::size_t i = 0; i < content.fixes.size(); ++i) {
    const MapFix& f = content.fixes[i];
    const std::string name = "fix " + std::to_string(i);
    if (!hasKey(f.key)) return name + " is of a key pose that is not there";
    if (!isPositive(f.cov_map_m2)) return name + " has no positive covariance";
    if (!(f.weight >= 0 && f.weight <= 1)) return name + " has a weight beyond 0 .. 1";
  }
  const double length_m = info.waypoint_spacing_m * static_cast<double>(content.waypoints.size());
  double last_m = -1;
  for (const RoadStation& r : content.road) {
    if (!(r.station_m > last_m && r.station_m >= 0 && r.station_m < length_m))
      return "stations of the road are out of order";
    last_m = r.station_m;
  }
  std::pair last(-1, -1.0);
  for (const WallPoint& w : content.walls) {
    const std::pair now(static_cast<int>(w.side), w.station_m);
    if (!(now > last && (w.side == WallSide::left || w.side == WallSide::right) && w.station_m >= 0 &&
          w.station_m < length_m))
      return "stations of the walls are out of order";
    last = now;
  }
  return "";
}

std::string wrongIdOf(const MapContent& content) {
  constexpr double kWithin_m = 50;  // half the widest road, with the pit lane beside it
  for (std::size_t i = 0; i < content.key_poses.size(); ++i) {
    const KeyPose& k = content.key_poses[i];
    if (!k.racetrack_id) continue;
    const MapWaypoint& w = content.waypoints[static_cast<std::size_t>(*k.racetrack_id)];
    const double away_m = (w.p_map_m - k.T_map_body.translation()).head<2>().norm();
    const double turned_rad = std::abs(wrapAngle(yawOf(k.T_map_body) - w.heading_rad));
    if (away_m > kWithin_m || turned_rad > 90 * kDegree)
      return "key pose " + std::to_string(i) + " is " + std::to_string(away_m) + " m and " +
             std::to_string(turned_rad / kDegree) + " deg away from the way-point of its racetrack ID " +
             std::to_string(*k.racetrack_id);
  }
  return "";
}

}  // namespace raceloc
