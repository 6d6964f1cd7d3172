#include "sensors/kitti.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include "core/errors.h"
#include "sensors/gps_conversion.h"
#include "sensors/text_input.h"

namespace raceloc {

namespace {

constexpr double kSmallestSigma_m = 0.01;
constexpr double kVerticalRatio = 1.5;
constexpr double kAngleSigma_rad = 0.1 * M_PI / 180;
constexpr double kNominalEpoch_s = 1'317'600'000;  // 2011-10-03 00:00:00 UTC
constexpr double kNominalRate_hz = 10;

// ---- Files

std::vector<double> readStamps(const std::string& path, double utc_offset_h) {
  std::vector<double> stamps_s;
  for (const auto& line : readLines("KITTI stamps", path)) {
    if (line.empty()) continue;
    const auto local_s = parseCivilTime(line);
    if (!local_s)
      throw InputError("KITTI stamps " + path + ", line " + std::to_string(stamps_s.size() + 1) +
                       ": not a time YYYY-MM-DD hh:mm:ss.f: " + line);
    stamps_s.push_back(*local_s - utc_offset_h * 3600);
  }
  return stamps_s;
}

/** Numbers after `tag` in a calibration file of lines `tag: numbers`. */
std::vector<double> readTagged(const std::string& path, const std::string& tag, std::size_t count) {
  const auto lines = readLines("KITTI calibration", path);
  for (std::size_t i = 0; i < lines.size(); ++i)
    if (lines[i].rfind(tag + ":", 0) == 0)
      return parseNumbers("KITTI calibration " + path + ", line " + std::to_string(i + 1),
                          lines[i].substr(tag.size() + 1), count);
  throw InputError("KITTI calibration " + path + ": no line " + tag + ":");
}

Pose rigid(const Eigen::Matrix3d& almost_rotation, const Eigen::Vector3d& p_m) {
  Pose T = Pose::Identity();
  T.linear() = Eigen::Quaterniond(almost_rotation).normalized().toRotationMatrix();  // the file rounds
  T.translation() = p_m;
  return T;
}

Pose fromRows(const std::vector<double>& v) {
  const auto rows = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(v.data());
  return rigid(rows.leftCols<3>(), rows.col(3));
}

/** The number that is a file's name. */
std::size_t numberOf(const std::string& path) {
  const std::string stem = std::filesystem::path(path).stem().string();
  if (stem.empty() || stem.size() > 12 || stem.find_first_not_of("0123456789") != std::string::npos)
    throw InputError("scan " + path + ": the name is no frame number");
  return std::stoul(stem);
}

// ---- OXTS

struct OxtsPacket {
  double stamp_s;
  GeodeticPoint position;  ///< of the IMU
  double roll_rad, pitch_rad, yaw_rad, forward_mps;
  Eigen::Vector3d specific_force_mps2, rate_rps;
  double position_sigma_m;
  int navigation_status, position_mode;
};

OxtsPacket readPacket(const std::string& path, double stamp_s) {
  const auto lines = readLines("OXTS packet", path);
  const auto v = parseNumbers("OXTS packet " + path + ", line 1", lines.empty() ? "" : lines[0], 30);
  if (std::abs(v[0]) > 90 || std::abs(v[1]) > 180 || v[23] < 0)
    throw InputError("OXTS packet " + path + ", line 1: latitude, longitude or accuracy is out of range");
  return {stamp_s,
          {v[0], v[1], v[2]},
          v[3],
          v[4],
          v[5],
          v[8],
          {v[11], v[12], v[13]},
          {v[17], v[18], v[19]},
          std::max(v[23], kSmallestSigma_m),
          static_cast<int>(v[25]),
          static_cast<int>(v[27])};
}

std::vector<OxtsPacket> readPackets(const KittiRawDrive& drive) {
  const std::string folder = drive.folder + "/oxts";
  const auto stamps_s = readStamps(folder + "/timestamps.txt", drive.utc_offset_h);
  const auto files = filesIn("OXTS packets", folder + "/data", ".txt");
  if (files.size() != stamps_s.size())
    throw InputError("OXTS packets " + folder + ": " + std::to_string(files.size()) + " files, but " +
                     std::to_string(stamps_s.size()) + " lines in timestamps.txt");
  std::vector<OxtsPacket> packets;
  for (std::size_t i = 0; i < files.size(); ++i) packets.push_back(readPacket(files[i], stamps_s[i]));
  for (std::size_t i = 1; i < packets.size(); ++i)
    if (!(packets[i].stamp_s > packets[i - 1].stamp_s))
      throw InputError("KITTI stamps " + folder + "/timestamps.txt, line " + std::to_string(i + 1) +
                       ": not later than the line before");
  return packets;
}

int fixQuality(int position_mode) {
  switch (position_mode) {
    case 3:
    case 13:
      return 1;
    case 4:
    case 7:
    case 8:
    case 9:
    case 14:
      return 2;
    case 5:
    case 15:
      return 5;
    case 6:
    case 16:
      return 4;
    default:
      return 6;
  }
}

Pose mapFromBody(const OxtsPacket& packet, const GeodeticPoint& origin, const Eigen::Vector3d& p_body_imu_m) {
  // The packet's angles are about its own east, north and up.
  const Pose T_here_imu =
      poseFromRpy(Eigen::Vector3d::Zero(), packet.roll_rad, packet.pitch_rad, packet.yaw_rad);
  return mapFromMap(origin, packet.position) * T_here_imu * Eigen::Translation3d(-p_body_imu_m);
}

std::vector<Sample> samplesOf(const OxtsPacket& packet, const Pose& T_map_body,
                              const Eigen::Vector3d& noise_map_m, const Eigen::Vector3d& p_body_imu_m) {
  std::vector<Sample> samples;
  if (packet.navigation_status >= 3) {
    const Eigen::Vector3d sigmas_m = packet.position_sigma_m * Eigen::Vector3d(1, 1, kVerticalRatio);
    const Eigen::Matrix3d cov_map_m2 = sigmas_m.cwiseAbs2().asDiagonal();
    const Eigen::Matrix3d R = T_map_body.linear();
    Matrix6d covariance = Matrix6d::Zero();
    covariance.topLeftCorner<3, 3>().diagonal().setConstant(kAngleSigma_rad * kAngleSigma_rad);
    covariance.bottomRightCorner<3, 3>() = R.transpose() * cov_map_m2 * R;
    Pose T_noisy = T_map_body;
    T_noisy.translation() += noise_map_m;
    samples.emplace_back(InsPose{packet.stamp_s, "gps_oxts", T_noisy, covariance});
    samples.emplace_back(GpsFix{packet.stamp_s, "gps_oxts", T_noisy * p_body_imu_m, cov_map_m2, p_body_imu_m,
                                fixQuality(packet.position_mode)});
  }
  samples.emplace_back(
      ImuSample{packet.stamp_s, "imu_oxts", packet.rate_rps, packet.specific_force_mps2, p_body_imu_m});
  const double speed_mps = packet.forward_mps - packet.rate_rps.cross(p_body_imu_m).x();
  samples.emplace_back(MotionSample{packet.stamp_s, "vehicle", speed_mps, packet.rate_rps.z()});
  return samples;
}

// ---- Scans

struct ScanFile {
  std::string path;
  double start_s, end_s;
};

/** One of the three stamp files of the scans. */
struct StampFile {
  StampFile(const KittiRawDrive& drive, const std::string& name)
      : path(drive.folder + "/velodyne_points/" + name), stamps_s(readStamps(path, drive.utc_offset_h)) {}
  [[nodiscard]] double at(std::size_t number) const {
    if (number < stamps_s.size()) return stamps_s[number];
    throw InputError("KITTI stamps " + path + ": no line " + std::to_string(number + 1) +
                     ", but there is a scan " + std::to_string(number));
  }
  std::string path;
  std::vector<double> stamps_s;
};

std::vector<ScanFile> findScans(const KittiRawDrive& drive) {
  const auto files = filesIn("KITTI scans", drive.folder + "/velodyne_points/data", ".bin");
  const StampFile starts(drive, "timestamps_start.txt");
  const StampFile forward(drive, "timestamps.txt");
  const StampFile ends(drive, "timestamps_end.txt");
  std::vector<ScanFile> scans;
  for (const auto& file : files) {
    const std::size_t number = numberOf(file);
    const ScanFile scan{file, starts.at(number), ends.at(number)};
    if (!(scan.start_s < forward.at(number) && forward.at(number) < scan.end_s))
      throw InputError("KITTI stamps " + forward.path + ", line " + std::to_string(number + 1) +
                       ": not between the start and the end of the sweep");
    if (drive.decimation.keeps(number)) scans.push_back(scan);
  }
  return scans;
}

std::vector<float> timesOfPoints(const Cloud& cloud, double duration_s, SweepDirection sweep) {
  std::vector<float> times_s;
  if (sweep == SweepDirection::none) return times_s;
  times_s.reserve(cloud.size());
  const double sign = sweep == SweepDirection::counter_clockwise ? 1 : -1;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const double turned_rad = sign * std::atan2(cloud.y[i], cloud.x[i]) + M_PI;
    times_s.push_back(static_cast<float>(turned_rad / (2 * M_PI) * duration_s));
  }
  return times_s;
}

}  // namespace

ImportSummary importLog(const KittiRawDrive& drive, const std::string& log_path, const ShareDone& done) {
  requireFolder("KITTI drive", drive.folder);
  const auto packets = readPackets(drive);
  const auto scans = findScans(drive);
  if (scans.empty()) throw InputError("KITTI scans " + drive.folder + ": the decimation keeps none");

  const std::string calibration =
      (std::filesystem::path(drive.folder + "/.").parent_path().parent_path() / "calib_imu_to_velo.txt")
          .string();
  const auto R = readTagged(calibration, "R", 9);
  const auto p = readTagged(calibration, "T", 3);
  const Pose T_velo_imu = rigid(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R.data()),
                                Eigen::Vector3d(p[0], p[1], p[2]));
  const Pose T_body_lidar = Eigen::Translation3d(drive.p_body_imu_m) * T_velo_imu.inverse();

  ImportSummary summary;
  summary.origin = drive.origin ? drive.origin : packets.front().position;
  summary.truth = Trajectory{summary.origin, {}};
  ImportLog log(log_path,
                {summary.origin,
                 "// imported from the KITTI raw drive " +
                     std::filesystem::path(drive.folder + "/.").parent_path().filename().string() + "\n"});
  std::mt19937_64 engine(drive.gps_noise.seed);
  std::normal_distribution<double> noise(0, 1);
  std::size_t uninitialised = 0;
  std::size_t coasting = 0;
  std::size_t next_scan = 0;
  const auto writeScansUntil = [&](double stamp_s) {
    for (; next_scan < scans.size() && scans[next_scan].start_s < stamp_s; ++next_scan) {
      const auto& file = scans[next_scan];
      Scan scan{file.start_s, "lidar_top", T_body_lidar, readVelodyneBin(file.path), {}, {}};
      scan.time_s = timesOfPoints(scan.cloud, file.end_s - file.start_s, drive.sweep);
      log.write(scan);
      done(static_cast<double>(next_scan + 1) / static_cast<double>(scans.size()));
    }
  };
  for (const auto& packet : packets) {
    writeScansUntil(packet.stamp_s);
    const Pose T_map_body = mapFromBody(packet, *summary.origin, drive.p_body_imu_m);
    summary.truth->poses.push_back({packet.stamp_s, T_map_body});
    const double east = noise(engine);  // one draw after the other: their order is part of the seed's meaning
    const double north = noise(engine);
    const Eigen::Vector3d noise_map_m = drive.gps_noise.sigma_m * Eigen::Vector3d(east, north, 0);
    for (const auto& sample : samplesOf(packet, T_map_body, noise_map_m, drive.p_body_imu_m))
      log.write(sample);
    uninitialised += packet.navigation_status < 3 ? 1 : 0;
    coasting += packet.position_mode == 0 ? 1 : 0;
  }
  writeScansUntil(std::numeric_limits<double>::infinity());
  summary.devices = log.commit();

  if (uninitialised > 0)
    summary.notes.push_back(std::to_string(uninitialised) +
                            " OXTS packets gave no GPS fix: INS not initialised");
  if (coasting > 0)
    summary.notes.push_back(std::to_string(coasting) +
                            " OXTS packets without a GPS position: kept as dead reckoning");
  if (drive.gps_noise.sigma_m > 0)
    summary.notes.push_back("noise of " + std::to_string(drive.gps_noise.sigma_m) +
                            " m on each horizontal axis of GPS and INS; the truth is clean");
  return summary;
}

ImportSummary importLog(const KittiOdometrySequence& sequence, const std::string& log_path,
                        const ShareDone& done) {
  requireFolder("KITTI sequence", sequence.folder);
  const std::filesystem::path folder = std::filesystem::path(sequence.folder + "/.").parent_path();
  const auto files = filesIn("KITTI scans", (folder / "velodyne").string(), ".bin");
  const std::string calibration = (folder / "calib.txt").string();
  const Pose T_cam_lidar = fromRows(readTagged(calibration, "Tr", 12));
  const Pose T_body_lidar(Eigen::Translation3d(sequence.p_body_lidar_m));
  const Pose T_cam_body = T_cam_lidar * T_body_lidar.inverse();

  ImportSummary summary;
  const auto stampOfNumber = [](std::size_t number) {
    return kNominalEpoch_s + static_cast<double>(number) / kNominalRate_hz;
  };
  const std::filesystem::path poses =
      folder.parent_path().parent_path() / "poses" / (folder.filename().string() + ".txt");
  const std::size_t first_number =
      sequence.first_number ? static_cast<std::size_t>(*sequence.first_number) : numberOf(files.front());
  if (std::filesystem::exists(poses)) {
    summary.truth = Trajectory{};
    Pose T_body0_cam0 = Pose::Identity();
    const auto lines = readLines("KITTI poses", poses.string());
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const Pose T_cam0_cam = fromRows(
          parseNumbers("KITTI poses " + poses.string() + ", line " + std::to_string(i + 1), lines[i], 12));
      if (i == 0) T_body0_cam0 = (T_cam0_cam * T_cam_body).inverse();
      summary.truth->poses.push_back(
          {stampOfNumber(first_number + i), T_body0_cam0 * T_cam0_cam * T_cam_body});
    }
    if (lines.empty()) throw InputError("KITTI poses " + poses.string() + ": holds no pose");
  } else {
    summary.notes.push_back("no truth: there is no " + poses.string());
  }

  ImportLog log(log_path, {std::nullopt, "// imported from KITTI odometry sequence " +
                                             folder.filename().string() + "; stamps are nominal, 10 Hz\n"});
  std::size_t kept = 0;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (!sequence.decimation.keeps(i)) continue;
    log.write(Scan{
        stampOfNumber(numberOf(files[i])), "lidar_top", T_body_lidar, readVelodyneBin(files[i]), {}, {}});
    ++kept;
    done(static_cast<double>(i + 1) / static_cast<double>(files.size()));
  }
  if (kept == 0) throw InputError("KITTI scans " + sequence.folder + ": the decimation keeps none");
  summary.devices = log.commit();
  summary.notes.emplace_back("the benchmark has no stamps, GPS or speed: 10 Hz from 2011-10-03 00:00:00 UTC");
  return summary;
}

}  // namespace raceloc
