/** \file
 * The KITTI data sets. Source: Geiger, Lenz, Stiller, Urtasun, "Vision meets robotics: the KITTI dataset",
 * IJRR 2013. */
#pragma once

#include <optional>
#include <string>

#include "sensors/foreign_logs.h"

namespace raceloc {

/** Which way the LiDAR turns, seen from above; `none`: write no times of points. */
enum class SweepDirection { counter_clockwise, clockwise, none };

/** A raw drive, `DATE/DATE_drive_NNNN_sync`, with `calib_imu_to_velo.txt` in the folder above it.
 *
 * Devices: `lidar_top`; `gps_oxts` with its INS pose; `imu_oxts`; `vehicle` (KITTI has no wheel speed:
 * forward speed of the INS, moved to the body's origin, and its yaw rate). Body: centre of the rear axle.
 *
 * Scan: stamped with its start. A point's time is the share of the turn from straight behind to its azimuth,
 * times the duration of this sweep; times.txt's forward instant is in the middle.
 *
 * OXTS: position and attitude are the IMU's; the GPS fix is that position with the IMU's place as lever arm,
 * its sigma the packet's pos_accuracy (horizontally; 1.5 times that vertically, the usual ratio; at least 1
 * cm). Its quality is by posmode: 3, 13 -> single; 4, 7, 8, 9, 14 -> DGPS; 5, 15 -> RTK float; 6, 16 -> RTK
 * fixed; others, 0 among them -> dead reckoning (the INS coasts, and its pos_accuracy says how well). The INS
 * pose has the same position sigmas and 0.1 deg for each angle, as its maker states; the lever arm to the
 * body adds no more than 2 mm. Packets whose navstat is below 3 (not initialised) give neither.
 *
 * Noise goes alike on the GPS fix and on the INS pose of a packet, and the reported covariances stay: they
 * then lie. Truth: the clean pose of the body at each packet. Map origin: the first packet's position,
 * whatever the decimation, so that all logs of one drive share a frame. */
struct KittiRawDrive {
  std::string folder;
  Decimation decimation;  ///< by the number in the scan's file name
  /** Measured on drive 2011_09_26_0013: mapped with clockwise times it has 682 flat pieces of wall, with
   * counter-clockwise ones 433 and without times 477, and it fits the GPS best. */
  SweepDirection sweep = SweepDirection::clockwise;
  double utc_offset_h = 2;  ///< of the stamps, which are local time without a zone: CEST
  /** From figure 3 of the paper: the IMU is 0.93 m above ground, the wheels' axles 0.30 m; the IMU is 0.05 m
   * before the rear axle and 0.32 m left of the middle, where the LiDAR is. */
  Eigen::Vector3d p_body_imu_m{0.05, 0.32, 0.63};
  std::optional<GeodeticPoint> origin;
  GpsNoise gps_noise;
};

/** \throws InputError naming the file (and line) for anything missing, malformed or truncated. */
[[nodiscard]] ImportSummary importLog(const KittiRawDrive& drive, const std::string& log_path,
                                      const ShareDone& done);

/** A sequence of the odometry benchmark, `.../sequences/NN`; its poses, when there are any, are in
 * `../../poses/NN.txt`. Scans are motion compensated already: no times of points. Stamps are 10 Hz from a
 * nominal epoch, 2011-10-03 00:00:00 UTC, by the number in the file name. No GPS and no speed. Truth: the
 * body's poses, from its first pose on, which is the origin of a local frame. */
struct KittiOdometrySequence {
  std::string folder;
  Decimation decimation;  ///< by position in the folder
  std::optional<int>
      first_number;  ///< file number that goes with the first pose line; default: the first file's
  /** Of the LiDAR in the body, as in the raw drives; its attitude is taken to be the body's. */
  Eigen::Vector3d p_body_lidar_m{0.86, 0, 1.43};
};

/** \throws InputError naming the file (and line) for anything missing, malformed or truncated. */
[[nodiscard]] ImportSummary importLog(const KittiOdometrySequence& sequence, const std::string& log_path,
                                      const ShareDone& done);

}  // namespace raceloc
