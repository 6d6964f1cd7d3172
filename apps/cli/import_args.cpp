#include "cli/import_args.h"

#include <cmath>
#include <functional>
#include <memory>
#include <sstream>
#include <utility>
#include <vector>

#include "cli/app.h"
#include "cli/text_options.h"
#include "core/errors.h"
#include "core/options.h"
#include "core/output_file.h"
#include "sensors/text_input.h"

namespace raceloc {

namespace {

constexpr char kImportManual[] = R"(NAME
  raceloc-import - foreign recordings to MRPT rawlogs

SYNOPSIS
  raceloc-import kitti-raw DRIVE_DIR -o LOG [--truth FILE] [--decimate even|odd|N] [--gps-noise-m S --seed N] ...
  raceloc-import kitti-odometry SEQ_DIR -o LOG [--truth FILE] [--decimate even|odd|N] ...
  raceloc-import pcd DIR -o LOG [--poses FILE] [--rate HZ] [--truth FILE] ...
  raceloc-import csv [DIR] -c INI -o LOG [--gps-noise-m S --seed N]
  raceloc-import pcap FILE -o LOG [--model vlp16|hdl32|hdl64] ...
  raceloc-import FORMAT --help

DESCRIPTION
  Writes one rawlog of stock MRPT classes with one label a device, sensor poses, UTC stamps, times of LiDAR points, GPS
  with covariance, INS poses, IMU and speed, as far as the recording has them. RawLogViewer and rawlog-edit open it.
  Prints the devices with their rates and gaps, and what was dropped and why.
  Files appear under their names only when they are whole.

FORMATS
  kitti-raw        a raw drive of KITTI, with calib_imu_to_velo.txt in the folder above it
  kitti-odometry   a sequence of KITTI's odometry benchmark: scans and true poses
  pcd              a folder of PCD files (ascii or binary), one a scan
  csv              GPS, IMU and vehicle logs; an ini file says which column is what
  pcap             a packet capture of a Velodyne LiDAR

EXAMPLES
  raceloc-import kitti-raw build/data/kitti_raw/2011_09_26/2011_09_26_drive_0013_sync --decimate even \
                 -o build/survey.rawlog --truth build/truth.tum
  raceloc-import kitti-odometry build/data/kitti_odom/sequences/01 -o build/motorway.rawlog --truth build/motorway.tum
  raceloc-import csv ../shared/data/barber_gr86 -c ini/import_csv_barber.ini -o build/barber.rawlog
  raceloc-import pcap capture.pcap --model vlp16 -o build/capture.rawlog

EXIT STATUS
  0 done; 2 bad input or arguments, one line on stderr says what and where; 1 an error of the program.
)";

constexpr char kKittiRaw[] = R"(NAME
  raceloc-import kitti-raw - a KITTI raw drive to a rawlog

DESCRIPTION
  Labels: lidar_top, gps_oxts (with the pose of its INS), imu_oxts, vehicle (speed and yaw rate, from the INS).
  Map frame: east, north, up about the drive's first INS position, whatever the decimation, so that all logs of one
  drive share it. Body frame: centre of the rear axle. The truth is the INS's pose of the body.

EXAMPLES
  raceloc-import kitti-raw 2011_09_26/2011_09_26_drive_0013_sync --decimate even -o survey.rawlog --truth truth.tum
  raceloc-import kitti-raw 2011_09_26/2011_09_26_drive_0013_sync --decimate odd -o bad_gps.rawlog --gps-noise-m 10

EXIT STATUS
  0 done; 2 bad input or arguments; 1 an error of the program.
)";

constexpr char kKittiOdometry[] = R"(NAME
  raceloc-import kitti-odometry - a sequence of KITTI's odometry benchmark to a rawlog

DESCRIPTION
  Label: lidar_top. Scans are motion compensated, so points have no times. Stamps are nominal, 10 Hz from 2011-10-03
  00:00:00 UTC. The truth, from ../../poses/NN.txt, starts at the identity; it has no geodetic origin.

EXAMPLES
  raceloc-import kitti-odometry sequences/01 -o motorway.rawlog --truth motorway.tum

EXIT STATUS
  0 done; 2 bad input or arguments; 1 an error of the program.
)";

constexpr char kPcd[] = R"(NAME
  raceloc-import pcd - a folder of PCD files to a rawlog

DESCRIPTION
  One scan a file, in order of names, which are taken for stamps when they are times since the epoch: 19 digits [ns],
  16 digits [us], or 10 digits with or without a fraction [s]. Otherwise --rate spaces the scans from 0 s on.
  Fields: x y z, intensity or i, ring, time or t or timestamp (float: seconds; integer: nanoseconds).
  The truth, when wanted, is a checked copy of --poses.

EXAMPLES
  raceloc-import pcd scans --poses truth.tum --lidar-pose "1.2 0 1.0 0 0 0" -o drive.rawlog --truth build/truth.tum

EXIT STATUS
  0 done; 2 bad input or arguments; 1 an error of the program.
)";

constexpr char kCsv[] = R"(NAME
  raceloc-import csv - GPS, IMU and vehicle logs to a rawlog

DESCRIPTION
  DIR holds the CSV files (default: the current folder); the ini's sections [gps], [imu] and [vehicle] name file,
  columns, units and stamps; see ini/import_csv_barber.ini. Rows with an empty cell in a column that is needed are
  dropped and counted. Map frame: about the first fix.

EXAMPLES
  raceloc-import csv ../shared/data/barber_gr86 -c ini/import_csv_barber.ini -o build/barber.rawlog

EXIT STATUS
  0 done; 2 bad input or arguments; 1 an error of the program.
)";

constexpr char kPcap[] = R"(NAME
  raceloc-import pcap - a packet capture of a Velodyne LiDAR to a rawlog

DESCRIPTION
  Labels: lidar_top, and gps_lidar when a GPS was plugged into the LiDAR. Stamps are satellite time when there is any,
  else the time of capture. The capture must be a classic pcap (editcap -F pcap converts others).

EXAMPLES
  raceloc-import pcap sample_velodyne_vlp16_gps.pcap -o vlp16.rawlog
  raceloc-import pcap hdl32.pcap --model hdl32 --decimate 2 -o hdl32.rawlog

EXIT STATUS
  0 done; 2 bad input or arguments; 1 an error of the program.
)";

/** The program's name, and the words after the format's. */
using Words = std::vector<std::string>;

/** Arguments of one format: what all share, and those that some do. */
class FormatLine {
 public:
  explicit FormatLine(const char* manual) : line(manual) {
    output = std::make_unique<Text>("o", "output", "rawlog to write", true, "", "LOG", line);
  }
  Text& add(const std::string& name, const std::string& meaning, const std::string& value,
            const std::string& kind) {
    return *options.emplace_back(std::make_unique<Text>("", name, meaning, false, value, kind, line));
  }
  Text& addDecimate() {
    return add("decimate", "LiDAR scans to keep: even, odd, or every Nth (default 1: all)", "1",
               "even|odd|N");
  }
  Text& addTruth() { return add("truth", "write the true trajectory, TUM", "", "FILE"); }
  Text& addNoise() {
    return add("gps-noise-m",
               "white noise on each horizontal axis of GPS and INS positions; covariances stay as they "
               "are [m] (default 0)",
               "0", "M");
  }
  Text& addSeed() { return add("seed", "of the noise (default 1)", "1", "N"); }
  Text& addLidarPose() {
    return add("lidar-pose", "LiDAR in the body [m, deg] (default: zeros)", "0 0 0 0 0 0",
               "\"x y z roll pitch yaw\"");
  }

  /** False after `--help` or `--version`. */
  bool parse(Words words) { return line.parse(std::move(words)); }

  CommandLine line;
  std::unique_ptr<Text> output;
  std::vector<std::unique_ptr<Text>> options;
};

using Position = TCLAP::UnlabeledValueArg<std::string>;

GpsNoise noiseOf(Text& sigma, Text& seed) {
  return {numberOf(sigma, between(0, 1e6)), static_cast<std::uint32_t>(wholeNumberOf(seed, between(0, 2e9)))};
}

Pose poseOf(Text& option) {
  const auto v = numbersOf(option, 6);
  const double rad = M_PI / 180;
  return poseFromRpy({v[0], v[1], v[2]}, v[3] * rad, v[4] * rad, v[5] * rad);
}

std::optional<ImportArgs> parseKittiRaw(const Words& words) {
  FormatLine f(kKittiRaw);
  KittiRawDrive drive;
  Position folder("DRIVE_DIR", "folder of the drive, DATE_drive_NNNN_sync", true, "", "DRIVE_DIR", f.line);
  Text& truth = f.addTruth();
  Text& decimate = f.addDecimate();
  Text& noise = f.addNoise();
  Text& seed = f.addSeed();
  Text& sweep = f.add("sweep",
                      "how the LiDAR turns, seen from above: cw (default), ccw, or none for no times of "
                      "points",
                      "cw", "cw|ccw|none");
  Text& offset = f.add("utc-offset-h", "of the stamps, which have no zone [h] (default 2: CEST)", "2", "H");
  Text& imu = f.add("imu", "IMU in the body [m] (default: KITTI's)", "", "\"x y z\"");
  Text& origin = f.add("origin", "of the map frame (default: the drive's first position)", "",
                       "\"lat_deg lon_deg height_m\"");
  if (!f.parse(words)) return std::nullopt;
  drive.folder = folder.getValue();
  drive.decimation = parseDecimation(decimate.getValue());
  drive.gps_noise = noiseOf(noise, seed);
  drive.sweep = choiceOf<SweepDirection>(sweep, {{"ccw", SweepDirection::counter_clockwise},
                                                 {"cw", SweepDirection::clockwise},
                                                 {"none", SweepDirection::none}});
  drive.utc_offset_h = numberOf(offset, between(-24, 24));
  if (imu.isSet()) drive.p_body_imu_m = Eigen::Vector3d(numbersOf(imu, 3).data());
  if (origin.isSet()) {
    const auto v = numbersOf(origin, 3);
    if (std::abs(v[0]) > 90 || std::abs(v[1]) > 180)
      throw InputError("--origin " + origin.getValue() + ": latitude or longitude is out of range");
    drive.origin = GeodeticPoint{v[0], v[1], v[2]};
  }
  return ImportArgs{drive, f.output->getValue(), truth.getValue()};
}

std::optional<ImportArgs> parseKittiOdometry(const Words& words) {
  FormatLine f(kKittiOdometry);
  KittiOdometrySequence sequence;
  Position folder("SEQ_DIR", "folder of the sequence, .../sequences/NN", true, "", "SEQ_DIR", f.line);
  Text& truth = f.addTruth();
  Text& decimate = f.addDecimate();
  Text& first =
      f.add("first-number", "scan number that goes with the first pose (default: the first scan's)", "", "N");
  Text& lidar = f.add("lidar", "LiDAR in the body [m] (default: KITTI's)", "", "\"x y z\"");
  if (!f.parse(words)) return std::nullopt;
  sequence.folder = folder.getValue();
  sequence.decimation = parseDecimation(decimate.getValue());
  if (first.isSet()) sequence.first_number = wholeNumberOf(first, between(0, 1e6));
  if (lidar.isSet()) sequence.p_body_lidar_m = Eigen::Vector3d(numbersOf(lidar, 3).data());
  return ImportArgs{sequence, f.output->getValue(), truth.getValue()};
}

std::optional<ImportArgs> parsePcd(const Words& words) {
  FormatLine f(kPcd);
  PcdFolder source;
  Position folder("DIR", "folder of the PCD files", true, "", "DIR", f.line);
  Text& poses = f.add("poses", "true poses of the body, TUM", "", "FILE");
  Text& truth = f.addTruth();
  Text& decimate = f.addDecimate();
  Text& rate = f.add("rate", "scans a second where file names are no times (default 10)", "10", "HZ");
  Text& label = f.add("label", "of the LiDAR in the rawlog (default lidar_top)", source.label, "LABEL");
  Text& lidar = f.addLidarPose();
  Text& intensity = f.add("intensity-max", "value that becomes intensity 1 (default 255)", "255", "X");
  if (!f.parse(words)) return std::nullopt;
  source.folder = folder.getValue();
  source.poses_path = poses.getValue();
  if (truth.isSet() && !poses.isSet())
    throw InputError("--truth needs --poses: PCD files have no truth of their own");
  source.decimation = parseDecimation(decimate.getValue());
  source.rate_hz = numberOf(rate, above(0));
  source.label = label.getValue();
  source.T_body_lidar = poseOf(lidar);
  source.intensity_max = numberOf(intensity, above(0));
  return ImportArgs{source, f.output->getValue(), truth.getValue()};
}

std::optional<ImportArgs> parseCsv(const Words& words) {
  FormatLine f(kCsv);
  CsvLog source;
  Position folder("DIR", "folder of the CSV files (default: the current one)", false, source.folder, "DIR",
                  f.line);
  Text ini("c", "config", "ini file with the column map", true, "", "INI", f.line);
  Text& noise = f.addNoise();
  Text& seed = f.addSeed();
  if (!f.parse(words)) return std::nullopt;
  source.folder = folder.getValue();
  source.ini_path = ini.getValue();
  source.gps_noise = noiseOf(noise, seed);
  return ImportArgs{source, f.output->getValue(), ""};
}

std::optional<ImportArgs> parsePcap(const Words& words) {
  FormatLine f(kPcap);
  VelodynePcap source;
  Position path("FILE", "the capture", true, "", "FILE", f.line);
  Text& decimate = f.addDecimate();
  Text& model = f.add("model", "of the LiDAR (default vlp16)", "vlp16", "vlp16|hdl32|hdl64");
  Text& calibration = f.add("calibration", "the maker's XML file (obligatory for an HDL-64)", "", "FILE");
  Text& label = f.add("label", "of the LiDAR in the rawlog (default lidar_top)", source.label, "LABEL");
  Text& lidar = f.addLidarPose();
  Text& height =
      f.add("height-m", "of the GPS above the ellipsoid, which RMC lacks [m] (default 0)", "0", "M");
  if (!f.parse(words)) return std::nullopt;
  source.path = path.getValue();
  source.decimation = parseDecimation(decimate.getValue());
  source.model = choiceOf<VelodyneModel>(
      model,
      {{"vlp16", VelodyneModel::vlp16}, {"hdl32", VelodyneModel::hdl32}, {"hdl64", VelodyneModel::hdl64}});
  source.calibration_path = calibration.getValue();
  source.label = label.getValue();
  source.T_body_lidar = poseOf(lidar);
  source.height_m = numberOf(height, between(-1000, 10000));
  return ImportArgs{source, f.output->getValue(), ""};
}

}  // namespace

std::optional<ImportArgs> parseImportArgs(int argc, char** argv) {
  using Parser = std::optional<ImportArgs> (*)(const Words&);
  const std::vector<std::pair<std::string, Parser>> formats{{"kitti-raw", parseKittiRaw},
                                                            {"kitti-odometry", parseKittiOdometry},
                                                            {"pcd", parsePcd},
                                                            {"csv", parseCsv},
                                                            {"pcap", parsePcap}};
  std::vector<std::string> names;
  names.reserve(formats.size());
  for (const auto& format : formats) names.push_back(format.first);
  const std::string word = argc > 1 ? argv[1] : "";
  if (word.empty()) throw InputError("no format given; one of: " + listed(names) + " (see --help)");
  if (word[0] == '-') {
    CommandLine line(kImportManual);
    if (!line.parse(argc, argv)) return std::nullopt;
  }
  for (const auto& [name, parse] : formats) {
    if (name != word) continue;
    Words words(argv + 1, argv + argc);
    words[0] = argv[0];
    return parse(words);
  }
  const std::string nearest = nearestName(word, names);
  throw InputError("unknown format " + word +
                   (nearest.empty() ? "; one of: " + listed(names) : "; did you mean " + nearest + "?"));
}

ImportSummary runImport(const ImportArgs& args) {
  if (!args.truth_path.empty())
    const OutputFile writable(args.truth_path);  // fails before the long work, not after
  Progress progress("importing");
  auto summary = std::visit(
      [&](const auto& source) {
        return importLog(source, args.log_path, [&](double share) { progress(share); });
      },
      args.source);
  if (args.truth_path.empty()) return summary;
  if (!summary.truth)
    throw InputError("output " + args.truth_path + ": the recording has no truth; the rawlog is written");
  writeTum(args.truth_path, *summary.truth);
  return summary;
}

}  // namespace raceloc
