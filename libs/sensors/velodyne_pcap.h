/** \file
 * Packet captures of Velodyne LiDARs, decoded by MRPT's driver. */
#pragma once

#include <string>

#include "sensors/foreign_logs.h"

namespace raceloc {

enum class VelodyneModel { vlp16, hdl32, hdl64 };

/** A capture by tcpdump or Wireshark in the classic pcap format.
 *
 * Stamps: satellite time when the LiDAR had a GPS. A sweep without it is stamped by the LiDAR's own clock,
 * shifted so as to agree with the first sweep that has satellite time, else with the time at which its first
 * packet was captured.
 *
 * The LiDAR's GPS packets (RMC) become fixes of `gps_label`: 2.5 m horizontally, as a single receiver has;
 * RMC has no height: `height_m`, with a sigma of 100 m. The map origin is the first of them. */
struct VelodynePcap {
  std::string path;
  VelodyneModel model = VelodyneModel::vlp16;
  std::string
      calibration_path;   ///< the maker's XML; obligatory for an HDL-64, empty: the model's nominal angles
  Decimation decimation;  ///< by sweep
  std::string label = "lidar_top";
  std::string gps_label = "gps_lidar";
  Pose T_body_lidar = Pose::Identity();
  double height_m = 0;
};

/** The first and last sweep are cut by the capture: MRPT passes the first on and drops the last.
 * \throws InputError if the file cannot be read, is no pcap, or holds no whole sweep. */
[[nodiscard]] ImportSummary importLog(const VelodynePcap& source, const std::string& log_path,
                                      const ShareDone& done);

}  // namespace raceloc
