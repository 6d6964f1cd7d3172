#include "track/circuit.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <optional>

#include "core/errors.h"
#include "core/text_file.h"
#include "track/csv_numbers.h"

namespace raceloc {

namespace {

constexpr double kGrid_m = 0.5;  // of the profiles along the segments
constexpr std::size_t kCells_per_point = 4;
constexpr double kMaxMiss_share = 0.01;  // of the length, or of a full turn
constexpr double kMaxLength_m = 30'000;
constexpr double kMinWidth_m = 1, kMaxWidth_m = 50;  // from the centre line to an edge

enum class Turn { straight, left, right };

/** Section [segment_NN]; what a segment does not state is as in [segments]. */
struct Segment {
  double length_m = 0;
  Turn turn = Turn::straight;
  double radius_m = 100;
  double bank_start_deg = 0, bank_end_deg = 0;
  double grade_percent = 0;
  double right_m = 6, left_m = 6;
  double wall_right_height_m = 1, wall_right_offset_m = 3, fence_right_m = 0;
  double wall_left_height_m = 1, wall_left_offset_m = 3, fence_left_m = 0;

  void describe(OptionList& keys) {
    keys.add("length_m", length_m, between(0, kMaxLength_m), "along the centre line [m]");
    keys.add<Turn>("turn", turn, {{"straight", Turn::straight}, {"left", Turn::left}, {"right", Turn::right}},
                   "which way the segment bends");
    keys.add("radius_m", radius_m, atLeast(5), "of a turn, at the centre line [m]");
    keys.add("bank_start_deg", bank_start_deg, between(-45, 45), "bank, the right edge up is positive [deg]");
    keys.add("bank_end_deg", bank_end_deg, between(-45, 45), "bank at the segment's end [deg]");
    keys.add("grade_percent", grade_percent, between(-30, 30),
             "rise of the centre line, uphill is positive [%]");
    keys.add("right_m", right_m, between(kMinWidth_m, kMaxWidth_m),
             "from the centre line to the right edge [m]");
    keys.add("left_m", left_m, between(kMinWidth_m, kMaxWidth_m),
             "from the centre line to the left edge [m]");
    keys.add("wall_right_height_m", wall_right_height_m, between(0, 20), "wall on the right, 0: none [m]");
    keys.add("wall_right_offset_m", wall_right_offset_m, between(0, 50),
             "from the right edge to that wall [m]");
    keys.add("fence_right_m", fence_right_m, between(0, 20), "catch-fence above that wall, 0: none [m]");
    keys.add("wall_left_height_m", wall_left_height_m, between(0, 20), "wall on the left, 0: none [m]");
    keys.add("wall_left_offset_m", wall_left_offset_m, between(0, 50), "from the left edge to that wall [m]");
    keys.add("fence_left_m", fence_left_m, between(0, 20), "catch-fence above that wall, 0: none [m]");
  }
  [[nodiscard]] double curvature_per_m() const {
    return turn == Turn::straight ? 0 : (turn == Turn::left ? 1 : -1) / radius_m;
  }
};

/** Section [track]. */
struct Header {
  std::string name;
  double origin_lat_deg = 45, origin_lon_deg = 9, origin_height_m = 100;
  double start_heading_deg = 90;
  double transition_m = 60;
  double post_spacing_m = 6;
  bool kerbs = false;
  std::string centreline_csv;

  void describe(OptionList& keys) {
    keys.add("name", name, "for people");
    keys.add("origin_lat_deg", origin_lat_deg, between(-89, 89), "of the start line, WGS84 [deg]");
    keys.add("origin_lon_deg", origin_lon_deg, between(-180, 180), "of the start line, WGS84 [deg]");
    keys.add("origin_height_m", origin_height_m, between(-500, 6000),
             "of the start line above the ellipsoid [m]");
    keys.add("start_heading_deg", start_heading_deg, between(-360, 360),
             "compass direction of driving at the start line, clockwise from north; not used with "
             "centreline_csv, whose x is east [deg]");
    keys.add("transition_m", transition_m, between(0, 500),
             "turns and banks begin and end over this length [m]");
    keys.add("post_spacing_m", post_spacing_m, between(1, 100), "between the posts of catch-fences [m]");
    keys.add("kerbs", kerbs, "kerbs at the edges of corners");
    keys.add("centreline_csv", centreline_csv,
             "take the road from this CSV (x_m,y_m,w_tr_right_m,w_tr_left_m; relative to this file) and not "
             "from segments");
  }
};

// ---- Segments

/** One quantity at the middle of each grid cell along the loop. */
using Profile = std::vector<double>;

/** Cyclic moving average over 2 `half` + 1 cells. */
Profile averaged(const Profile& in, std::size_t half) {
  const std::size_t n = in.size();
  Profile out(n);
  double sum = 0;
  for (std::size_t k = 0; k <= 2 * half; ++k) sum += in[(k + n - half) % n];
  for (std::size_t i = 0; i < n; ++i) {
    out[i] = sum / static_cast<double>(2 * half + 1);
    sum += in[(i + half + 1) % n] - in[(i + n - half) % n];
  }
  return out;
}

struct Profiles {
  double step_m;
  Profile curvature_per_m, bank_rad, grade, right_m, left_m;
};

Profiles profilesOf(const std::vector<Segment>& segments, double length_m, double transition_m) {
  // A whole number of points of the line, so that the last gap of the loop is as long as the others.
  const auto n =
      kCells_per_point * static_cast<std::size_t>(std::ceil(length_m / (kCells_per_point * kGrid_m)));
  Profiles p;
  p.step_m = length_m / static_cast<double>(n);
  for (auto* profile : {&p.curvature_per_m, &p.bank_rad, &p.grade, &p.right_m, &p.left_m}) profile->resize(n);
  // Means over the cells, not values at their middles: a turn keeps its total angle to the last digit.
  double begin_m = 0;
  for (const auto& segment : segments) {
    const double end_m = begin_m + segment.length_m;
    for (auto i = static_cast<std::size_t>(begin_m / p.step_m); i < n; ++i) {
      const double from_m = std::max(begin_m, static_cast<double>(i) * p.step_m);
      const double to_m = std::min(end_m, static_cast<double>(i + 1) * p.step_m);
      if (from_m >= end_m) break;
      const double share = std::max(0.0, to_m - from_m) / p.step_m;
      const double along = (0.5 * (from_m + to_m) - begin_m) / segment.length_m;
      p.curvature_per_m[i] += share * segment.curvature_per_m();
      p.bank_rad[i] += share * kDegree *
                       (segment.bank_start_deg + along * (segment.bank_end_deg - segment.bank_start_deg));
      p.grade[i] += share * segment.grade_percent / 100;
      p.right_m[i] += share * segment.right_m;
      p.left_m[i] += share * segment.left_m;
    }
    begin_m = end_m;
  }
  const auto half = std::min(static_cast<std::size_t>(transition_m / 4 / p.step_m), (n - 1) / 2);
  for (auto* profile : {&p.curvature_per_m, &p.bank_rad, &p.grade, &p.right_m, &p.left_m})
    *profile = averaged(averaged(*profile, half), half);
  return p;
}

/** Where the line is after each grid cell, heading first; the start (0, 0, 0) comes first. */
std::vector<Eigen::Vector3d> integrated(const Profiles& p, double start_rad) {
  std::vector<Eigen::Vector3d> line{Eigen::Vector3d::Zero()};
  line.reserve(p.grade.size() + 1);
  double heading_rad = start_rad;
  for (std::size_t i = 0; i < p.grade.size(); ++i) {
    const double middle_rad = heading_rad + 0.5 * p.step_m * p.curvature_per_m[i];
    const double flat = 1 / std::hypot(1, p.grade[i]);
    line.emplace_back(line.back() +
                      p.step_m * flat *
                          Eigen::Vector3d(std::cos(middle_rad), std::sin(middle_rad), p.grade[i]));
    heading_rad += p.step_m * p.curvature_per_m[i];
  }
  return line;
}

double sum(const Profile& profile) { return std::accumulate(profile.begin(), profile.end(), 0.0); }

struct ClosedLine {
  std::vector<TrackPoint> points;
  ClosureMiss miss;
};

ClosedLine closed(Profiles p, double length_m, double start_rad, const std::string& path) {
  ClosureMiss miss;
  const double turned_rad = p.step_m * sum(p.curvature_per_m);
  miss.heading_rad = turned_rad - 2 * M_PI * std::round(turned_rad / (2 * M_PI));
  miss.gap_m = integrated(p, start_rad).back().head<2>().norm();
  const double bend =
      std::accumulate(p.curvature_per_m.begin(), p.curvature_per_m.end(), 0.0,
                      [](double total, double curvature) { return total + std::abs(curvature); });
  for (double& curvature : p.curvature_per_m)
    if (bend > 0) curvature -= miss.heading_rad / p.step_m * std::abs(curvature) / bend;
  const auto line = integrated(p, start_rad);
  // Turning the heading right moves the end too: what is left to distribute may be more than what was missed.
  miss.gap_m = std::max(miss.gap_m, line.back().head<2>().norm());
  miss.height_m = line.back().z();
  if (miss.gap_m > kMaxMiss_share * length_m || std::abs(miss.height_m) > kMaxMiss_share * length_m ||
      std::abs(miss.heading_rad) > kMaxMiss_share * 2 * M_PI) {
    char text[240];
    std::snprintf(text, sizeof text,
                  ": the segments do not close: their end misses the start by %.1f m (%.2f %% of %.1f m; at "
                  "most 1 %%), %.1f m in height and %.2f deg; change lengths, radii or grades",
                  miss.gap_m, 100 * miss.gap_m / length_m, length_m, miss.height_m,
                  miss.heading_rad / kDegree);
    throw InputError("track " + path + text);
  }

  ClosedLine result{{}, miss};
  const std::size_t n = p.grade.size();
  for (std::size_t i = 0; i < n; i += kCells_per_point) {
    const std::size_t before = (i + n - 1) % n;
    const auto here = [&](const Profile& profile) { return 0.5 * (profile[before] + profile[i]); };
    result.points.push_back({line[i] - static_cast<double>(i) / static_cast<double>(n) * line.back(),
                             here(p.bank_rad), here(p.right_m), here(p.left_m)});
  }
  return result;
}

/** The walls on one side, neighbours of one kind joined; stations are scaled to the closed track's. */
void addBarriers(const std::vector<Segment>& segments, Side side, double scale,
                 std::vector<Barrier>& barriers) {
  const std::size_t first = barriers.size();
  double begin_m = 0;
  for (const auto& segment : segments) {
    const double end_m = begin_m + segment.length_m;
    const bool left = side == Side::left;
    const Barrier barrier{scale * begin_m,
                          scale * end_m,
                          side,
                          left ? segment.wall_left_offset_m : segment.wall_right_offset_m,
                          left ? segment.wall_left_height_m : segment.wall_right_height_m,
                          left ? segment.fence_left_m : segment.fence_right_m};
    begin_m = end_m;
    if (barrier.height_m == 0) continue;
    if (barriers.size() > first) {
      Barrier& last = barriers.back();
      if (last.to_m == barrier.from_m && last.offset_m == barrier.offset_m &&
          last.height_m == barrier.height_m && last.fence_m == barrier.fence_m) {
        last.to_m = barrier.to_m;
        continue;
      }
    }
    barriers.push_back(barrier);
  }
}

/** In the order of their numbers, also where these are not padded: x_9 before x_10. */
std::vector<std::string> numbered(std::vector<std::string> sections) {
  std::sort(sections.begin(), sections.end(), [](const std::string& a, const std::string& b) {
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  });
  return sections;
}

std::vector<Segment> readSegments(IniFile& ini, const Segment& common) {
  std::vector<Segment> segments;
  for (const auto& section : numbered(ini.sections("segment_"))) {
    Segment segment = common;
    ini.load(section, segment);
    if (!(segment.length_m > 0))
      throw InputError("track " + ini.path() + ", section [" + section +
                       "]: length_m is missing or 0, but it must be > 0");
    segments.push_back(segment);
  }
  if (segments.empty())
    throw InputError("track " + ini.path() +
                     ": no section [segment_01], [segment_02], ... and no centreline_csv in [track]; "
                     "share/tracks/lvms.ini is an example");
  return segments;
}

// ---- Centre lines

/** Points of the CSV, the first one moved to the origin. */
ClosedLine readCentreLine(const std::string& path) {
  std::ifstream in = openText(path);
  if (!in) throw InputError("track " + path + ": cannot be read; check the path");
  ClosedLine line;
  double length_m = 0;
  std::string text;
  for (int number = 1; std::getline(in, text); ++number) {
    if (text.find_first_not_of(" \t\r") == std::string::npos || text[0] == '#' || text.rfind("x_m", 0) == 0)
      continue;
    const auto v = numbersIn(text);
    const std::string where = "track " + path + ", line " + std::to_string(number) + ": ";
    if (v.size() != 4) throw InputError(where + "not four numbers x_m,y_m,w_tr_right_m,w_tr_left_m: " + text);
    for (const std::size_t k : {2U, 3U})
      if (!(v[k] >= kMinWidth_m && v[k] <= kMaxWidth_m))
        throw InputError(where + (k == 2 ? "w_tr_right_m = " : "w_tr_left_m = ") + std::to_string(v[k]) +
                         ", but a width must be 1 to 50 m");
    const Eigen::Vector3d p_m(v[0], v[1], 0);
    if (!line.points.empty()) {
      const double gap_m = (p_m - line.points.back().p_map_m).norm();
      if (!(gap_m >= 0.2 && gap_m <= 20))
        throw InputError(where + std::to_string(gap_m) +
                         " m from the point before, but it must be 0.2 to 20 m");
      length_m += gap_m;
    }
    line.points.push_back({p_m, 0, v[2], v[3]});
    if (length_m > kMaxLength_m) throw InputError(where + "the line is longer than 30 km");
  }
  // Some files repeat the first point at the end; else the loop closes with one more step.
  const double gap_m =
      line.points.empty() ? 0 : (line.points.back().p_map_m - line.points.front().p_map_m).norm();
  if (gap_m < 0.2 && !line.points.empty()) line.points.pop_back();
  if (line.points.size() < 8)
    throw InputError("track " + path + ": " + std::to_string(line.points.size()) +
                     " points, but a circuit needs at least 8 lines x_m,y_m,w_tr_right_m,w_tr_left_m");
  if (gap_m > 20)
    throw InputError("track " + path + ": the line does not close: its end is " + std::to_string(gap_m) +
                     " m from its start, of " + std::to_string(length_m) + " m in all (at most 20 m)");
  const Eigen::Vector3d start_m = line.points.front().p_map_m;
  for (auto& point : line.points) point.p_map_m -= start_m;
  return line;
}

Circuit assembled(const std::string& path, const Header& header, const ClosedLine& line) {
  return {header.name,
          path,
          {header.origin_lat_deg, header.origin_lon_deg, header.origin_height_m},
          Track(line.points),
          {},
          {},
          header.post_spacing_m,
          header.kerbs,
          {},
          line.miss,
          {}};
}

Circuit circuitOfCsv(const std::string& path, const Header& header, const Segment& sides) {
  Circuit circuit = assembled(path, header, readCentreLine(path));
  circuit.notes.emplace_back("the centre line has no height and no bank: flat");
  Segment whole = sides;
  whole.length_m = circuit.track.length_m();
  for (const Side side : {Side::left, Side::right}) addBarriers({whole}, side, 1, circuit.barriers);
  return circuit;
}

Circuit circuitOfIni(const std::string& path) {
  IniFile ini(path);
  Header header;
  Segment common;
  Pace pace;
  ini.load("track", header);
  ini.load("segments", common);
  ini.load("pace", pace);
  std::vector<Scenery> scenery;
  for (const auto& section : numbered(ini.sections("scenery_"))) {
    ini.load(section, scenery.emplace_back());
    const auto& last = scenery.back();
    if (!(last.to_m > last.from_m))
      throw InputError("track " + path + ", section [" + section + "]: to_m = " + std::to_string(last.to_m) +
                       ", but it must be > from_m = " + std::to_string(last.from_m));
  }
  if (header.name.empty()) header.name = std::filesystem::path(path).stem().string();

  std::optional<Circuit> circuit;
  if (!header.centreline_csv.empty()) {
    ini.rejectUnknownSections();
    circuit.emplace(circuitOfCsv((std::filesystem::path(path).parent_path() / header.centreline_csv).string(),
                                 header, common));
  } else {
    const auto segments = readSegments(ini, common);
    ini.rejectUnknownSections();
    double length_m = 0;
    for (const auto& segment : segments) length_m += segment.length_m;
    if (length_m > kMaxLength_m || length_m < 50)
      throw InputError("track " + path + ": the segments are " + std::to_string(length_m) +
                       " m long, but it must be 50 m to 30 km");
    const auto profiles = profilesOf(segments, length_m, header.transition_m);
    circuit.emplace(
        assembled(path, header, closed(profiles, length_m, kDegree * (90 - header.start_heading_deg), path)));
    const double scale = circuit->track.length_m() / length_m;
    for (const Side side : {Side::left, Side::right}) addBarriers(segments, side, scale, circuit->barriers);
  }
  const double length_m = circuit->track.length_m();
  const auto sceneries = numbered(ini.sections("scenery_"));
  for (std::size_t k = 0; k < scenery.size(); ++k)
    if (scenery[k].from_m >= length_m || scenery[k].to_m - scenery[k].from_m > length_m)
      throw InputError("track " + path + ", section [" + sceneries[k] + "]: from_m = " +
                       std::to_string(scenery[k].from_m) + ", to_m = " + std::to_string(scenery[k].to_m) +
                       ", but the track is " + std::to_string(length_m) + " m long");
  circuit->scenery = scenery;
  circuit->pace = pace;
  circuit->path = path;
  return std::move(*circuit);
}

}  // namespace

void Scenery::describe(OptionList& keys) {
  keys.add<SceneryKind>("kind", kind,
                        {{"grandstand", SceneryKind::grandstand},
                         {"building", SceneryKind::building},
                         {"gantry", SceneryKind::gantry},
                         {"overpass", SceneryKind::overpass},
                         {"tunnel", SceneryKind::tunnel},
                         {"trees", SceneryKind::trees}},
                        "what stands there");
  keys.add("from_m", from_m, between(0, kMaxLength_m), "where it begins, along the centre line [m]");
  keys.add("to_m", to_m, between(0, kMaxLength_m), "where it ends [m]");
  keys.add<Side>("side", side, {{"left", Side::left}, {"right", Side::right}, {"both", Side::both}},
                 "of the road; a gantry, an overpass and a tunnel span it");
  keys.add("offset_m", offset_m, between(0, 200),
           "from the edge of the road to its face, or of its pillars [m]");
  keys.add("depth_m", depth_m, between(0.1, 200), "away from the road [m]");
  keys.add("height_m", height_m, between(0.1, 100),
           "of its top, or the clearance below what spans the road [m]");
}

void Pace::describe(OptionList& keys) {
  keys.add("top_speed_mps", top_speed_mps, between(3, 120), "never faster [m/s]");
  keys.add("lateral_limit_mps2", lateral_limit_mps2, between(1, 100),
           "sideways force on the car per mass, in the road's plane, that the driver accepts; the car's own "
           "limit holds too [m/s^2]");
}

Circuit readCircuit(const std::string& path) {
  if (std::filesystem::path(path).extension() != ".csv") return circuitOfIni(path);
  Header header;
  header.name = std::filesystem::path(path).stem().string();
  Circuit circuit = circuitOfCsv(path, header, Segment{});
  char text[160];
  std::snprintf(text, sizeof text,
                "a CSV has no place on earth: the start line is taken to be at %.1f N, %.1f E, %.0f m",
                header.origin_lat_deg, header.origin_lon_deg, header.origin_height_m);
  circuit.notes.emplace_back(text);
  circuit.notes.emplace_back(
      "walls of 1 m on both sides, 3 m from the edges; an ini with centreline_csv can say otherwise");
  return circuit;
}

}  // namespace raceloc
