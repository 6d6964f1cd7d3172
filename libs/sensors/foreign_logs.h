/** \file
 * What the imports of foreign logs share. Each source has its own header: kitti.h, pcd_folder.h, csv_log.h,
 * velodyne_pcap.h, with one function
 *   ImportSummary importLog(const SOURCE& source, const std::string& log_path, const ShareDone& done);
 * that writes the rawlog `log_path`, whole or not at all. */
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/trajectory.h"
#include "sensors/device_tally.h"
#include "sensors/rawlog.h"

namespace raceloc {

using ShareDone = std::function<void(double)>;  ///< told the share of the work that is done, 0..1

struct ImportSummary {
  std::vector<DeviceSummary> devices;
  std::vector<std::string> notes;       ///< what was dropped or assumed, and why
  std::optional<Trajectory> truth;      ///< when the source has one
  std::optional<GeodeticPoint> origin;  ///< of the map frame, when the source has GPS
};

/** The summary for people, several lines. */
[[nodiscard]] std::string toText(const ImportSummary& summary);

/** Which LiDAR scans are kept: number `first`, `first` + `every`, ... */
struct Decimation {
  std::size_t every = 1;
  std::size_t first = 0;
  [[nodiscard]] bool keeps(std::size_t number) const { return number % every == first; }
};

/** `even`, `odd`, or N >= 1 for every Nth from number 0 on. \throws InputError for anything else. */
[[nodiscard]] Decimation parseDecimation(const std::string& text);

/** White noise on positions, the same on both horizontal axes. */
struct GpsNoise {
  double sigma_m = 0;      ///< of each axis
  std::uint32_t seed = 1;  ///< same seed, same noise
};

/** A log being written and counted. */
class ImportLog {
 public:
  ImportLog(const std::string& path, const LogHeader& header) : x_writer(path, header) {}
  void write(const Sample& sample);
  [[nodiscard]] std::vector<DeviceSummary> commit();

 private:
  LogWriter x_writer;
  DeviceTally x_tally;
};

/** \throws InputError "`what` `folder`: no such folder" */
void requireFolder(const std::string& what, const std::string& folder);

/** Files in `folder` whose names end with `extension`, sorted by name.
 * \throws InputError if the folder cannot be read or holds none. */
[[nodiscard]] std::vector<std::string> filesIn(const std::string& what, const std::string& folder,
                                               const std::string& extension);

/** Reads a file of float32 `x y z intensity` records, as KITTI's, into the cloud; points that are not finite
 * are left out.
 * \throws InputError if it cannot be read, is empty, or its length is no multiple of 16. */
[[nodiscard]] Cloud readVelodyneBin(const std::string& path);

}  // namespace raceloc
