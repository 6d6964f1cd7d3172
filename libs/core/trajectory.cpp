#include "core/trajectory.h"

#include <cmath>
#include <cstdio>
#include <sstream>

#include "core/errors.h"
#include "core/text_file.h"

namespace raceloc {

namespace {
constexpr char kOriginTag[] = "# map origin (WGS84 lat_deg lon_deg height_m):";
}

TumWriter::TumWriter(const std::string& path, const std::optional<GeodeticPoint>& origin)
    : x_output(path), x_file(x_output.temporaryPath(), std::ios::binary) {
  if (origin) {
    char line[256];
    std::snprintf(line, sizeof line, "%s %.10f %.10f %.4f\n", kOriginTag, origin->latitude_deg,
                  origin->longitude_deg, origin->height_m);
    x_file << line;
  }
  x_file << "# stamp_s x_m y_m z_m qx qy qz qw\n";
  requireGood();
}

void TumWriter::write(const StampedPose& pose) {
  const Eigen::Quaterniond q(pose.T_map_body.linear());
  const Eigen::Vector3d p = pose.T_map_body.translation();
  char line[256];
  std::snprintf(line, sizeof line, "%.6f %.4f %.4f %.4f %.9f %.9f %.9f %.9f\n", pose.stamp_s, p.x(), p.y(),
                p.z(), q.x(), q.y(), q.z(), q.w());
  x_file << line;
  requireGood();
}

void TumWriter::commit() {
  x_file.close();
  requireGood();
  x_output.commit();
}

void TumWriter::requireGood() const {
  if (!x_file) throw cannotWrite(x_output.path());
}

namespace {
/** A pose in the spool: stamp and matrix, as they lie in memory. */
struct SpooledPose {
  double stamp_s;
  double matrix[16];
};
}  // namespace

PoseSpool::PoseSpool(const std::string& path)
    : x_output(path + ".spool"),
      x_file(x_output.temporaryPath(), std::ios::binary | std::ios::in | std::ios::out | std::ios::trunc) {
  if (!x_file) throw cannotWrite(x_output.path());
}

void PoseSpool::add(const StampedPose& pose) {
  SpooledPose spooled{pose.stamp_s, {}};
  Eigen::Map<Eigen::Matrix4d>(spooled.matrix) = pose.T_map_body.matrix();
  if (!x_file.write(reinterpret_cast<const char*>(&spooled), sizeof spooled))
    throw cannotWrite(x_output.path());
  ++x_count;
}

void PoseSpool::writeTo(TumWriter& writer, const Pose& T_map_odom) {
  x_file.flush();
  if (!x_file.seekg(0)) throw cannotWrite(x_output.path());
  for (std::size_t i = 0; i < x_count; ++i) {
    SpooledPose spooled{};
    if (!x_file.read(reinterpret_cast<char*>(&spooled), sizeof spooled)) throw cannotWrite(x_output.path());
    Pose T_odom_body;
    T_odom_body.matrix() = Eigen::Map<const Eigen::Matrix4d>(spooled.matrix);
    writer.write({spooled.stamp_s, T_map_odom * T_odom_body});
  }
}

void writeTum(const std::string& path, const Trajectory& trajectory) {
  TumWriter writer(path, trajectory.origin);
  for (const auto& pose : trajectory.poses) writer.write(pose);
  writer.commit();
}

Trajectory readTum(const std::string& path) {
  std::ifstream in = openText(path);
  if (!in) throw InputError("trajectory " + path + ": cannot be read; check the path");
  Trajectory trajectory;
  std::string line;
  const std::string tag = kOriginTag;
  for (int number = 1; std::getline(in, line); ++number) {
    const auto bad = [&](const std::string& what) {
      return InputError("trajectory " + path + ", line " + std::to_string(number) + ": " + what);
    };
    if (line.compare(0, tag.size(), tag) == 0) {
      std::istringstream fields(line.substr(tag.size()));
      GeodeticPoint origin{};
      if (!(fields >> origin.latitude_deg >> origin.longitude_deg >> origin.height_m))
        throw bad("unreadable origin");
      trajectory.origin = origin;
      continue;
    }
    if (line.find_first_not_of(" \t\r") == std::string::npos || line[0] == '#') continue;
    std::istringstream fields(line);
    double stamp_s = 0;
    double v[7];
    fields >> stamp_s;
    for (double& value : v) fields >> value;
    std::string rest;
    if (!fields || fields >> rest) throw bad("not eight numbers `stamp x y z qx qy qz qw`: " + line);
    const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
    if (!(std::abs(q.norm() - 1) < 1e-3)) throw bad("the quaternion is not of unit length: " + line);
    if (!trajectory.poses.empty() && !(stamp_s > trajectory.poses.back().stamp_s))
      throw bad("stamps must increase; sort the file and drop duplicates");
    Pose T = Pose::Identity();
    T.linear() = q.normalized().toRotationMatrix();
    T.translation() << v[0], v[1], v[2];
    trajectory.poses.push_back({stamp_s, T});
  }
  if (in.bad()) throw InputError("trajectory " + path + ": cannot be read to its end; check the disk");
  if (trajectory.poses.empty()) throw InputError("trajectory " + path + ": holds no pose");
  return trajectory;
}

}  // namespace raceloc
