#include "sensors/pcd_folder.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <optional>
#include <utility>

#include "core/errors.h"
#include "sensors/text_input.h"

namespace raceloc {

namespace {

constexpr std::size_t kMaxPoints = 50'000'000;  // of one file: more is a damaged header

struct Field {
  std::string name;
  char type = 'F';  ///< I, U or F, as in the file
  std::size_t size = 4;
  std::size_t count = 1;
  std::size_t column = 0;  ///< of its first value in an ascii line
  std::size_t offset = 0;  ///< of its first byte in a binary record
};

struct Header {
  std::vector<Field> fields;
  std::size_t points = 0;
  std::string data;
  std::size_t columns = 0, record_bytes = 0;

  [[nodiscard]] const Field* find(std::initializer_list<const char*> names) const {
    for (const auto& field : fields)
      for (const char* name : names)
        if (field.name == name) return &field;
    return nullptr;
  }
};

InputError badPcd(const std::string& path, const std::string& what) {
  return InputError("PCD " + path + ": " + what);
}

std::size_t wholeNumber(const std::string& path, const std::string& text, std::size_t limit) {
  const auto number = parseNumber(text);
  if (!number || *number < 0 || *number > static_cast<double>(limit) || *number != std::floor(*number))
    throw badPcd(path, "unreadable number in the header: " + text);
  return static_cast<std::size_t>(*number);
}

/** Reads up to and including the DATA line. */
Header readHeader(std::istream& in, const std::string& path) {
  Header header;
  for (std::string line; header.data.empty();) {
    if (!std::getline(in, line)) throw badPcd(path, "the header has no DATA line; is this a PCD file?");
    if (!line.empty() && line.back() == '\r') line.pop_back();
    const auto words = split(line, ' ');
    if (words.empty() || words[0][0] == '#') continue;
    const auto& key = words[0];
    const bool per_field = key == "SIZE" || key == "TYPE" || key == "COUNT";
    if (per_field && words.size() != header.fields.size() + 1)
      throw badPcd(path, key + " does not have one value a field");
    if (key == "FIELDS")
      for (std::size_t i = 1; i < words.size(); ++i) header.fields.push_back({words[i]});
    for (std::size_t i = 1; per_field && i < words.size(); ++i) {
      Field& field = header.fields[i - 1];
      if (key == "SIZE") field.size = wholeNumber(path, words[i], 8);
      if (key == "TYPE") field.type = words[i][0];
      if (key == "COUNT") field.count = wholeNumber(path, words[i], 1'000'000);
    }
    if (key == "POINTS" && words.size() == 2) header.points = wholeNumber(path, words[1], kMaxPoints);
    if (key == "DATA" && words.size() == 2) header.data = words[1];
  }
  for (auto& field : header.fields) {
    field.column = header.columns;
    field.offset = header.record_bytes;
    header.columns += field.count;
    header.record_bytes += field.count * field.size;
  }
  return header;
}

template <class Number>
double numberAt(const char* bytes) {
  Number number{};
  std::memcpy(&number, bytes, sizeof number);
  return static_cast<double>(number);
}

double binaryValue(const Field& field, const char* record) {
  const char* bytes = record + field.offset;
  switch (field.type) {
    case 'F':
      return field.size == 8 ? numberAt<double>(bytes) : numberAt<float>(bytes);
    case 'U':
      if (field.size == 1) return numberAt<std::uint8_t>(bytes);
      if (field.size == 2) return numberAt<std::uint16_t>(bytes);
      return field.size == 8 ? numberAt<std::uint64_t>(bytes) : numberAt<std::uint32_t>(bytes);
    default:
      if (field.size == 1) return numberAt<std::int8_t>(bytes);
      if (field.size == 2) return numberAt<std::int16_t>(bytes);
      return field.size == 8 ? numberAt<std::int64_t>(bytes) : numberAt<std::int32_t>(bytes);
  }
}

void requireKnownTypes(const Header& header, const std::string& path) {
  for (const auto& field : header.fields) {
    const bool known = field.type == 'F'
                           ? field.size == 4 || field.size == 8
                           : (field.type == 'U' || field.type == 'I') &&
                                 (field.size == 1 || field.size == 2 || field.size == 4 || field.size == 8);
    if (!known)
      throw badPcd(
          path, "field " + field.name + " is of the unknown type " + field.type + std::to_string(field.size));
  }
}

/** Puts the points of a file into a Scan, whatever their encoding. */
class PointSink {
 public:
  PointSink(const Header& header, const std::string& path, double intensity_max)
      : x_x(header.find({"x"})),
        x_y(header.find({"y"})),
        x_z(header.find({"z"})),
        x_intensity(header.find({"intensity", "i"})),
        x_ring(header.find({"ring"})),
        x_time(header.find({"time", "t", "timestamp"})),
        x_intensity_max(intensity_max) {
    if (x_x == nullptr || x_y == nullptr || x_z == nullptr) throw badPcd(path, "no fields x, y and z");
    x_scan.cloud.reserve(header.points);
  }

  template <class ValueOf>
  void add(const ValueOf& valueOf) {
    const Eigen::Vector3f p = Eigen::Vector3d(valueOf(*x_x), valueOf(*x_y), valueOf(*x_z)).cast<float>();
    if (!p.allFinite()) return;  // a double beyond the floats too
    x_scan.cloud.push(p);
    if (x_intensity != nullptr)
      x_scan.cloud.intensity.push_back(
          static_cast<float>(std::clamp(valueOf(*x_intensity) / x_intensity_max, 0.0, 1.0)));
    if (x_ring != nullptr) x_scan.ring.push_back(static_cast<float>(valueOf(*x_ring)));
    if (x_time != nullptr) x_times_s.push_back(valueOf(*x_time) * (x_time->type == 'F' ? 1 : 1e-9));
  }

  Scan finish() {
    const double first_s = x_times_s.empty() ? 0 : *std::min_element(x_times_s.begin(), x_times_s.end());
    for (const double time_s : x_times_s) x_scan.time_s.push_back(static_cast<float>(time_s - first_s));
    return std::move(x_scan);
  }

 private:
  const Field *x_x, *x_y, *x_z, *x_intensity, *x_ring, *x_time;
  double x_intensity_max;
  std::vector<double> x_times_s;
  Scan x_scan{0, "", Pose::Identity(), {}, {}, {}};
};

/** The time that a file's name states. */
std::optional<double> stampInName(const std::string& path) {
  const std::string stem = std::filesystem::path(path).stem().string();
  const std::size_t digits = std::min(stem.find_first_not_of("0123456789"), stem.size());
  if (stem.empty() || stem[0] == '0') return std::nullopt;
  if (digits == 10 && (digits == stem.size() || stem[10] == '.')) return parseNumber(stem);
  if (digits != stem.size() || (digits != 16 && digits != 19)) return std::nullopt;
  return std::stod(stem) * (digits == 19 ? 1e-9 : 1e-6);
}

}  // namespace

Scan readPcd(const std::string& path, double intensity_max) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw badPcd(path, "cannot be read; check the path");
  const Header header = readHeader(in, path);
  requireKnownTypes(header, path);
  PointSink sink(header, path, intensity_max);
  const auto truncated = [&](std::size_t found) {
    return badPcd(path, "truncated: the header says " + std::to_string(header.points) + " points, it holds " +
                            std::to_string(found));
  };
  if (header.data == "ascii") {
    std::string line;
    for (std::size_t i = 0; i < header.points; ++i) {
      if (!std::getline(in, line)) throw truncated(i);
      const auto words = split(line, ' ');
      if (words.size() != header.columns)
        throw badPcd(path, "point " + std::to_string(i + 1) + " does not have " +
                               std::to_string(header.columns) + " values: " + line.substr(0, 80));
      sink.add([&](const Field& field) {
        const auto& word = words[field.column];
        if (const auto value = parseNumber(word)) return *value;
        if (word == "nan" || word == "-nan" || word == "NaN") return std::numeric_limits<double>::quiet_NaN();
        throw badPcd(path, "point " + std::to_string(i + 1) + ": not a number: " + word);
      });
    }
  } else if (header.data == "binary") {
    std::vector<char> record(header.record_bytes);
    for (std::size_t i = 0; i < header.points; ++i) {
      if (!in.read(record.data(), static_cast<std::streamsize>(record.size()))) throw truncated(i);
      sink.add([&](const Field& field) { return binaryValue(field, record.data()); });
    }
  } else {
    throw badPcd(path, "its data are " + header.data +
                           ", but only ascii and binary are read; convert it with " +
                           "pcl_convert_pcd_ascii_binary");
  }
  return sink.finish();
}

ImportSummary importLog(const PcdFolder& source, const std::string& log_path, const ShareDone& done) {
  requireFolder("PCD folder", source.folder);
  const auto files = filesIn("PCD folder", source.folder, ".pcd");
  ImportSummary summary;
  if (!source.poses_path.empty()) {
    summary.truth = readTum(source.poses_path);
    summary.origin = summary.truth->origin;
  }
  const bool names_are_times = stampInName(files.front()).has_value();
  if (!names_are_times)
    summary.notes.push_back("file names are no times: stamps are " + std::to_string(source.rate_hz) +
                            " Hz from 0 s on");

  ImportLog log(log_path, {summary.origin, "// imported from a folder of PCD files\n"});
  std::size_t kept = 0;
  double last_s = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < files.size(); ++i) {
    const auto named_s = stampInName(files[i]);
    if (named_s.has_value() != names_are_times)
      throw badPcd(files[i],
                   "some file names are times [s, us or ns since the epoch] and some are not; rename them");
    const double stamp_s = named_s ? *named_s : static_cast<double>(i) / source.rate_hz;
    if (!(stamp_s > last_s)) throw badPcd(files[i], "its time is not later than that of the file before");
    last_s = stamp_s;
    if (!source.decimation.keeps(i)) continue;
    Scan scan = readPcd(files[i], source.intensity_max);
    scan.stamp_s = stamp_s;
    scan.label = source.label;
    scan.T_body_lidar = source.T_body_lidar;
    log.write(scan);
    ++kept;
    done(static_cast<double>(i + 1) / static_cast<double>(files.size()));
  }
  if (kept == 0) throw InputError("PCD folder " + source.folder + ": the decimation keeps none");
  summary.devices = log.commit();
  return summary;
}

}  // namespace raceloc
