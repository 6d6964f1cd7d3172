#include "track/driven_line.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "core/errors.h"
#include "core/text_file.h"
#include "track/csv_numbers.h"
#include "track/planar_cells.h"

namespace raceloc {

namespace {

constexpr double kMaxStep_m = 50;      // between the points of a file
constexpr std::size_t kMinPoints = 8;  // of a file

/** Where a CSV has its coordinates. */
struct Columns {
  std::size_t x = 0, y = 1;
  std::optional<std::size_t> z;
};

/** The columns that a line names; none if it does not name x_m and y_m. */
std::optional<Columns> namedColumns(std::string line) {
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c == ',' || c == ';' || c == '#' || c == '"'; }, ' ');
  std::istringstream words(line);
  std::optional<std::size_t> x, y, z;
  std::string word;
  for (std::size_t k = 0; words >> word; ++k) {
    if (word == "x_m") x = k;
    if (word == "y_m") y = k;
    if (word == "z_m") z = k;
  }
  if (!x || !y) return std::nullopt;
  return Columns{*x, *y, z};
}

}  // namespace

std::vector<Eigen::Vector3d> readDrivenLine(const std::string& path) {
  const std::string file = "racing line " + path;
  std::ifstream in = openText(path);
  if (!in) throw InputError(file + ": cannot be read; check the path");
  std::vector<Eigen::Vector3d> line;
  Columns columns;
  std::string text;
  for (int number = 1; std::getline(in, text); ++number) {
    if (const auto named = namedColumns(text)) {
      columns = *named;
      continue;
    }
    if (text.find_first_not_of(" \t\r") == std::string::npos || text[0] == '#') continue;
    const auto v = numbersIn(text);
    const std::string where = file + ", line " + std::to_string(number) + ": ";
    if (v.size() <= std::max({columns.x, columns.y, columns.z.value_or(0)}))
      throw InputError(where + "no x_m and y_m in it: " + text);
    const Eigen::Vector3d p_m(v[columns.x], v[columns.y], columns.z ? v[*columns.z] : 0);
    if (!line.empty() && !((p_m - line.back()).norm() <= kMaxStep_m))
      throw InputError(where + std::to_string((p_m - line.back()).norm()) +
                       " m from the point before, but at most 50 m are a step of a racing line");
    line.push_back(p_m);
  }
  constexpr double kSame_m = 0.05;  // some files repeat the first point at the end
  if (line.size() > 1 && (line.back() - line.front()).norm() < kSame_m) line.pop_back();
  if (line.size() < kMinPoints)
    throw InputError(file + ": " + std::to_string(line.size()) +
                     " points, but a racing line needs at least 8 lines x_m,y_m");
  const double gap_m = (line.back() - line.front()).norm();
  if (gap_m > kMaxStep_m)
    throw InputError(file + ": the line does not close: its end is " + std::to_string(gap_m) +
                     " m from its start (at most 50 m)");
  return line;
}

void FirstLapOptions::describe(OptionList& keys) {
  keys.add("step_m", step_m, between(0.5, 20), "between the points of the drive that count [m]");
  keys.add("close_m", close_m, between(0.5, 50), "the lap is closed this near to where it began [m] ...");
  keys.add("max_turn_deg", max_turn_deg, between(1, 90), "... on a course that differs by no more [deg] ...");
  keys.add("confirm_m", confirm_m, between(0, 1000), "... and after the two agree for this long [m]");
  keys.add("min_lap_m", min_lap_m, between(10, 50'000), "shorter loops are no laps [m]");
}

namespace {

/** The drive as points at steps, so that it has a course everywhere and standing still is no part of it. */
struct Drive {
  std::vector<Eigen::Vector3d> p_map_m;
  std::vector<double> course_rad;  ///< of the step to the next point; the last one as the one before

  Drive(const std::vector<Pose>& T_map_body, double step_m) {
    for (const auto& T : T_map_body) {
      const Eigen::Vector3d p_m = T.translation();
      if (p_m.allFinite() && (p_map_m.empty() || (p_m - p_map_m.back()).head<2>().norm() >= step_m))
        p_map_m.push_back(p_m);
    }
    for (std::size_t k = 0; k + 1 < p_map_m.size(); ++k) {
      const Eigen::Vector3d step = p_map_m[k + 1] - p_map_m[k];
      course_rad.push_back(std::atan2(step.y(), step.x()));
    }
    if (!course_rad.empty()) course_rad.push_back(course_rad.back());
  }
  [[nodiscard]] std::size_t size() const { return p_map_m.size(); }

  /** Distance between two of its places; infinite if their courses differ. */
  [[nodiscard]] double apart_m(std::size_t a, std::size_t b, double max_turn_rad) const {
    if (!(std::abs(wrapAngle(course_rad[a] - course_rad[b])) <= max_turn_rad))
      return std::numeric_limits<double>::infinity();
    return (p_map_m[a] - p_map_m[b]).norm();
  }
};

/** Whether the drive from `again` on stays with the drive from `first` on, for `steps` or until it ends. */
bool retraces(const Drive& drive, std::size_t first, std::size_t again, std::size_t steps, double close_m,
              double max_turn_rad) {
  std::size_t beside = first;
  for (std::size_t k = again; k < std::min(drive.size(), again + steps + 1); ++k) {
    // The earlier line may be a little longer or shorter than this one: the nearest of the next few.
    const std::size_t last = std::min(beside + 3, again - 1);
    for (std::size_t next = beside; next <= last; ++next)
      if (drive.apart_m(k, next, max_turn_rad) < drive.apart_m(k, beside, max_turn_rad)) beside = next;
    if (!(drive.apart_m(k, beside, max_turn_rad) <= close_m)) return false;
  }
  return true;
}

/** The places from `first` to `again` as a closed line. */
std::vector<Eigen::Vector3d> closedLap(const Drive& drive, std::size_t first, std::size_t again) {
  std::vector<Eigen::Vector3d> line(drive.p_map_m.begin() + static_cast<std::ptrdiff_t>(first),
                                    drive.p_map_m.begin() + static_cast<std::ptrdiff_t>(again) + 1);
  const Eigen::Vector3d ahead(std::cos(drive.course_rad[first]), std::sin(drive.course_rad[first]), 0);
  const Eigen::Vector3d gap_m = line.front() - line.back();
  const Eigen::Vector3d across_m = gap_m - gap_m.dot(ahead) * ahead;
  const auto last = static_cast<double>(line.size() - 1);
  for (std::size_t k = 0; k < line.size(); ++k) line[k] += static_cast<double>(k) / last * across_m;
  // What lies beside or beyond the first point is already the next lap.
  const double least_step_m = 0.5 * (line[1] - line[0]).norm();
  while (line.size() > 3 && (line.front() - line.back()).dot(ahead) < least_step_m) line.pop_back();
  return line;
}

}  // namespace

std::optional<std::vector<Eigen::Vector3d>> firstFullLap(const std::vector<Pose>& T_map_body,
                                                         const FirstLapOptions& options) {
  const Drive drive(T_map_body, options.step_m);
  const double max_turn_rad = options.max_turn_deg * kDegree;
  const auto stepsIn = [&](double length_m) {
    return static_cast<std::size_t>(std::ceil(length_m / options.step_m));
  };
  // Places this recent are near because the car has just been there.
  const std::size_t recent = stepsIn(4 * options.close_m), least = stepsIn(options.min_lap_m);

  PlanarCells earlier(options.close_m);
  for (std::size_t again = 0; again < drive.size(); ++again) {
    if (again >= recent) earlier.add(again - recent, drive.p_map_m[again - recent]);
    // The latest pass is what this place closes a loop with: a circle driven three times is no long lap.
    std::optional<std::size_t> first;
    double first_m = options.close_m;
    std::size_t latest = 0;
    for (const std::size_t k : earlier.near(drive.p_map_m[again])) {
      const double apart_m = drive.apart_m(again, k, max_turn_rad);
      if (apart_m > options.close_m) continue;
      if (k > latest + recent) first_m = options.close_m;  // a later pass than the one found before
      latest = k;
      if (apart_m > first_m) continue;
      first = k;
      first_m = apart_m;
    }
    if (first && again - *first >= least &&
        retraces(drive, *first, again, stepsIn(options.confirm_m), options.close_m, max_turn_rad))
      return closedLap(drive, *first, again);
  }
  return std::nullopt;
}

}  // namespace raceloc
