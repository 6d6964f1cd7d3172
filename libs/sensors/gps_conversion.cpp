#include "sensors/gps_conversion.h"

#include <mrpt/topography/conversions.h>

#include <cmath>

namespace raceloc {

namespace {

mrpt::topography::TGeodeticCoords toMrpt(const GeodeticPoint& point) {
  return {point.latitude_deg, point.longitude_deg, point.height_m};
}

/** Pose of a map frame in the earth-centred, earth-fixed frame. */
Pose earthFromMap(const GeodeticPoint& origin) {
  const double lat_rad = origin.latitude_deg * M_PI / 180;
  const double lon_rad = origin.longitude_deg * M_PI / 180;
  const Eigen::Vector3d east(-std::sin(lon_rad), std::cos(lon_rad), 0);
  const Eigen::Vector3d up(std::cos(lat_rad) * std::cos(lon_rad), std::cos(lat_rad) * std::sin(lon_rad),
                           std::sin(lat_rad));
  Pose T = Pose::Identity();
  T.linear() << east, up.cross(east), up;
  T.translation() = toEarth(origin);
  return T;
}

}  // namespace

Eigen::Vector3d toEarth(const GeodeticPoint& point) {
  mrpt::math::TPoint3D p;
  mrpt::topography::geodeticToGeocentric_WGS84(toMrpt(point), p);
  return {p.x, p.y, p.z};
}

Eigen::Vector3d toMap(const GeodeticPoint& point, const GeodeticPoint& origin) {
  mrpt::math::TPoint3D p;
  mrpt::topography::geodeticToENU_WGS84(toMrpt(point), p, toMrpt(origin));
  return {p.x, p.y, p.z};
}

GeodeticPoint fromMap(const Eigen::Vector3d& p_map_m, const GeodeticPoint& origin) {
  // Through the earth's centre, because MRPT's ENUToGeocentric takes the geocentric vertical: 17 m off in
  // height.
  const Eigen::Vector3d p_earth = earthFromMap(origin) * p_map_m;
  mrpt::topography::TGeodeticCoords point;
  mrpt::topography::geocentricToGeodetic({p_earth.x(), p_earth.y(), p_earth.z()}, point);
  return {point.lat.getDecimalValue(), point.lon.getDecimalValue(), point.height};
}

Pose mapFromMap(const GeodeticPoint& to, const GeodeticPoint& from) {
  if (to.latitude_deg == from.latitude_deg && to.longitude_deg == from.longitude_deg &&
      to.height_m == from.height_m)
    return Pose::Identity();
  return earthFromMap(to).inverse() * earthFromMap(from);
}

int weekRollovers(double behind_s) {
  constexpr double kDay_s = 86'400, kRollover_s = 1024 * 7 * kDay_s;
  const double times = std::round(behind_s / kRollover_s);
  return times >= 1 && times < 100 && std::abs(behind_s - times * kRollover_s) < kDay_s
             ? static_cast<int>(times)
             : 0;
}

}  // namespace raceloc
