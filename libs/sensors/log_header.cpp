#include "sensors/log_header.h"

#include <mrpt/obs/CObservationComment.h>

#include <charconv>
#include <cstdio>
#include <iterator>
#include <sstream>
#include <utility>

namespace raceloc {

using mrpt::obs::CObservationComment;

namespace {

std::string originText(const GeodeticPoint& origin) {
  char text[200];
  std::snprintf(text, sizeof text,
                "[raceloc]\norigin_lat_deg = %.17g\norigin_lon_deg = %.17g\norigin_height_m = %.17g\n",
                origin.latitude_deg, origin.longitude_deg, origin.height_m);
  return text;
}

constexpr char kGpsLabels[] = "gps_labels = ";

}  // namespace

LogHeader withGpsLabels(LogHeader header, const std::vector<std::string>& labels) {
  if (labels.empty() || !gpsLabelsIn(header).empty()) return header;
  if (!header.text.empty() && header.text.back() != '\n') header.text += '\n';
  header.text += std::string("[sensors]\n") + kGpsLabels;
  for (const auto& label : labels) header.text += label + " ";
  header.text.back() = '\n';
  return header;
}

std::vector<std::string> gpsLabelsIn(const LogHeader& header) {
  std::istringstream lines(header.text);
  const std::string key = kGpsLabels;
  for (std::string line; std::getline(lines, line);) {
    if (line.compare(0, key.size(), key) != 0) continue;
    std::istringstream words(line.substr(key.size()));
    return {std::istream_iterator<std::string>(words), {}};
  }
  return {};
}

CObservationComment toObservation(const LogHeader& header) {
  CObservationComment comment;
  comment.timestamp = INVALID_TIMESTAMP;  // else the wall clock: same samples, same file
  comment.text = (header.origin ? originText(*header.origin) : "") + header.text;
  return comment;
}

LogHeader headerIn(const CObservationComment& comment) {
  LogHeader foreign{std::nullopt, comment.text};
  std::istringstream lines(comment.text);
  std::string line;
  if (!std::getline(lines, line) || line.rfind("[raceloc]", 0) != 0) return foreign;
  GeodeticPoint origin{};
  for (auto [key, value] : {std::pair{"origin_lat_deg = ", &origin.latitude_deg},
                            std::pair{"origin_lon_deg = ", &origin.longitude_deg},
                            std::pair{"origin_height_m = ", &origin.height_m}}) {
    const std::string name = key;
    if (!std::getline(lines, line) || line.compare(0, name.size(), name) != 0) return foreign;
    const char* begin = line.data() + name.size();
    if (std::from_chars(begin, line.data() + line.size(), *value).ec != std::errc()) return foreign;
  }
  return {origin, std::string(std::istreambuf_iterator<char>(lines), {})};
}

}  // namespace raceloc
