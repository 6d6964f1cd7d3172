#include "sim/scenery.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace raceloc {

namespace {

using Eigen::Vector3d;

constexpr double kRow_m = 1.5;         // of the road and the walls
constexpr double kVerge_m = 6;         // beside the road where no wall says otherwise
constexpr double kBehindWall_m = 0.5;  // the verge goes on for this much
constexpr double kFoot_m = 1;          // how deep things stand in the ground

/** One side of the road: +1 left, -1 right. */
constexpr double signOf(Side side) { return side == Side::left ? 1 : -1; }

/** Heights between points that are known, weighted by the fourth power of the distance. */
class HeightBlend {
 public:
  static constexpr double kReach_m = 220;

  explicit HeightBlend(const std::vector<Vector3d>& known) : x_low(known.front()), x_high(known.front()) {
    for (const auto& p : known) {
      x_low = x_low.cwiseMin(p);
      x_high = x_high.cwiseMax(p);
    }
    x_low.array() -= kReach_m;
    x_high.array() += kReach_m;
    x_columns = bucketOf(x_high.x() - x_low.x()) + 1;
    x_buckets.resize(x_columns * (bucketOf(x_high.y() - x_low.y()) + 1));
    for (const auto& p : known)
      x_buckets[bucketOf(p.y() - x_low.y()) * x_columns + bucketOf(p.x() - x_low.x())].push_back(p);
  }
  [[nodiscard]] const Vector3d& low() const { return x_low; }  ///< corners of where there may be heights
  [[nodiscard]] const Vector3d& high() const { return x_high; }

  /** None where no known point is within kReach_m. */
  [[nodiscard]] std::optional<double> at(double x_m, double y_m) const {
    const std::size_t column = bucketOf(x_m - x_low.x()), row = bucketOf(y_m - x_low.y());
    double weights = 0, sum = 0;
    for (std::size_t j = row == 0 ? 0 : row - 1; j <= row + 1; ++j)
      for (std::size_t i = column == 0 ? 0 : column - 1; i <= column + 1; ++i) {
        if (i >= x_columns || j * x_columns + i >= x_buckets.size()) continue;
        for (const auto& p : x_buckets[j * x_columns + i]) {
          const double d2 = (p.x() - x_m) * (p.x() - x_m) + (p.y() - y_m) * (p.y() - y_m);
          if (d2 > kReach_m * kReach_m) continue;
          const double weight = 1 / (d2 * d2 + 1);
          weights += weight;
          sum += weight * p.z();
        }
      }
    return weights > 0 ? std::optional(sum / weights) : std::nullopt;
  }

 private:
  static std::size_t bucketOf(double way_m) {
    return static_cast<std::size_t>(std::max(0.0, way_m) / kReach_m);
  }
  Vector3d x_low, x_high;
  std::size_t x_columns;
  std::vector<std::vector<Vector3d>> x_buckets;  ///< of kReach_m, row by row
};

class Builder {
 public:
  Builder(const Circuit& circuit, std::uint64_t seed)
      : x_circuit(circuit), x_track(circuit.track), x_noise(seed, "scenery") {}

  Mesh build() && {
    addRoad();
    for (const auto& barrier : x_circuit.barriers) addBarrier(barrier);
    for (const auto& scenery : x_circuit.scenery) {
      for (const Side side : {Side::left, Side::right})
        if (scenery.side == side || scenery.side == Side::both) addBeside(scenery, side);
      addAcross(scenery);
    }
    addGround();
    return std::move(x_mesh);
  }

 private:
  /** Width of the verge: to the back of the nearest wall, if there is one. */
  [[nodiscard]] double verge_m(double s_m, Side side) const {
    double width_m = kVerge_m;
    const double s = x_track.wrapped(s_m);
    for (const auto& barrier : x_circuit.barriers)
      if (barrier.side == side && s >= barrier.from_m && s <= barrier.to_m)
        width_m = std::max(1.0, barrier.offset_m + kBehindWall_m);
    return width_m;
  }

  /** A point beside the road: on the banked surface to the end of the verge, level from there on.
   * \param out_m    from the edge of the road, outwards
   * \param above_m  above that ground, straight up */
  [[nodiscard]] Vector3d beside(double s_m, Side side, double out_m, double above_m) const {
    const RoadFrame centre = x_track.at(s_m);
    const double edge_m = side == Side::left ? centre.left_m : centre.right_m;
    const double banked_m = std::min(out_m, verge_m(s_m, side));
    const Vector3d left = centre.T_map_road.linear().col(1);
    const Vector3d level = Vector3d(left.x(), left.y(), 0).normalized();
    return centre.T_map_road.translation() +
           signOf(side) * ((edge_m + banked_m) * left + (out_m - banked_m) * level) + Vector3d(0, 0, above_m);
  }

  /** Calls `section(begin_m, end_m)` for each piece of [from, to] of at most `piece_m`. */
  template <class Section>
  static void along(double from_m, double to_m, double piece_m, Section section) {
    const auto pieces = static_cast<std::size_t>(std::max(1.0, std::ceil((to_m - from_m) / piece_m)));
    const double step_m = (to_m - from_m) / static_cast<double>(pieces);
    for (std::size_t i = 0; i < pieces; ++i) {
      const double begin_m = from_m + static_cast<double>(i) * step_m;
      section(begin_m, begin_m + step_m);
    }
  }

  void addRoad() {
    // Across: verge, edge, inner side of the painted line, half way, centre, and so on.
    constexpr double kLine_m = 0.15;
    constexpr std::size_t kAcross = 9;
    const auto rows = static_cast<std::uint32_t>(std::ceil(x_track.length_m() / kRow_m));
    for (std::uint32_t i = 0; i < rows; ++i) {
      const double s_m = x_track.length_m() * i / rows;
      const RoadFrame frame = x_track.at(s_m);
      const double r_m = frame.right_m, l_m = frame.left_m;
      for (const double n_m : {-r_m - verge_m(s_m, Side::right), -r_m, kLine_m - r_m, -0.5 * r_m, 0.0,
                               0.5 * l_m, l_m - kLine_m, l_m, l_m + verge_m(s_m, Side::left)})
        x_mesh.vertex(frame.T_map_road * Vector3d(0, n_m, 0));
    }
    constexpr Material kStrips[kAcross - 1] = {Material::grass,   Material::paint,   Material::asphalt,
                                               Material::asphalt, Material::asphalt, Material::asphalt,
                                               Material::paint,   Material::grass};
    for (std::uint32_t i = 0; i < rows; ++i) {
      const std::uint32_t here = i * kAcross, next = (i + 1) % rows * kAcross;
      for (std::uint32_t k = 0; k + 1 < kAcross; ++k)
        x_mesh.quad(here + k, next + k, next + k + 1, here + k + 1, kStrips[k]);
    }
    if (x_circuit.kerbs)
      along(0, x_track.length_m(), kRow_m, [&](double s0, double s1) { addKerbs(s0, s1); });
  }

  void addKerbs(double begin_m, double end_m) {
    constexpr double kSharpest_m = 250, kWidth_m = 0.8, kHeight_m = 0.06;
    if (std::abs(x_track.at(begin_m).turn_per_m.z()) < 1 / kSharpest_m) return;
    const auto material = static_cast<long>(begin_m / kRow_m) % 2 == 0 ? Material::paint : Material::concrete;
    for (const Side side : {Side::left, Side::right}) {
      x_mesh.quad(beside(begin_m, side, 0, 0), beside(end_m, side, 0, 0),
                  beside(end_m, side, kWidth_m, kHeight_m), beside(begin_m, side, kWidth_m, kHeight_m),
                  material);
      addUpright(begin_m, end_m, side, kWidth_m, -kHeight_m, kHeight_m, material);
    }
  }

  /** A vertical strip along the road. */
  void addUpright(double begin_m, double end_m, Side side, double out_m, double bottom_m, double top_m,
                  Material material) {
    x_mesh.quad(beside(begin_m, side, out_m, bottom_m), beside(end_m, side, out_m, bottom_m),
                beside(end_m, side, out_m, top_m), beside(begin_m, side, out_m, top_m), material);
  }
  /** A horizontal one. */
  void addFlat(double begin_m, double end_m, Side side, double out_m, double far_out_m, double above_m,
               Material material) {
    x_mesh.quad(beside(begin_m, side, out_m, above_m), beside(end_m, side, out_m, above_m),
                beside(end_m, side, far_out_m, above_m), beside(begin_m, side, far_out_m, above_m), material);
  }
  /** A block along the road, bent with it, with its two ends. */
  void addBlock(double begin_m, double end_m, Side side, double out_m, double far_out_m, double bottom_m,
                double top_m, Material material) {
    addUpright(begin_m, end_m, side, out_m, bottom_m, top_m, material);
    addUpright(begin_m, end_m, side, far_out_m, bottom_m, top_m, material);
    addFlat(begin_m, end_m, side, out_m, far_out_m, top_m, material);
    if (bottom_m > 0) addFlat(begin_m, end_m, side, out_m, far_out_m, bottom_m, material);
    for (const double s_m : {begin_m, end_m})
      x_mesh.quad(beside(s_m, side, out_m, bottom_m), beside(s_m, side, far_out_m, bottom_m),
                  beside(s_m, side, far_out_m, top_m), beside(s_m, side, out_m, top_m), material);
  }

  void addBarrier(const Barrier& b) {
    constexpr double kThick_m = 0.3;
    along(b.from_m, b.to_m, kRow_m, [&](double s0, double s1) {
      addUpright(s0, s1, b.side, b.offset_m, -kFoot_m, b.height_m, Material::concrete);
      addUpright(s0, s1, b.side, b.offset_m + kThick_m, -kFoot_m, b.height_m, Material::concrete);
      addFlat(s0, s1, b.side, b.offset_m, b.offset_m + kThick_m, b.height_m, Material::concrete);
    });
    if (b.fence_m == 0) return;
    constexpr double kPost_m = 0.12, kCable_m = 0.03;
    const double middle_m = b.offset_m + 0.5 * kThick_m, top_m = b.height_m + b.fence_m;
    along(b.from_m, b.to_m, x_circuit.post_spacing_m, [&](double s0, double /*next post*/) {
      addBlock(s0 - 0.5 * kPost_m, s0 + 0.5 * kPost_m, b.side, middle_m, middle_m + kPost_m, b.height_m,
               top_m, Material::metal);
    });
    constexpr int kCables = 5;
    along(b.from_m, b.to_m, 2 * kRow_m, [&](double s0, double s1) {
      for (int k = 1; k <= kCables; ++k) {
        const double at_m = b.height_m + b.fence_m * k / kCables;
        addUpright(s0, s1, b.side, middle_m, at_m - kCable_m, at_m, Material::metal);
      }
    });
  }

  void addBeside(const Scenery& x, Side side) {
    switch (x.kind) {
      case SceneryKind::grandstand: {
        constexpr double kStep_m = 2;
        const int steps = std::max(1, static_cast<int>(x.depth_m / kStep_m));
        const double step_m = x.depth_m / steps, rise_m = (x.height_m - 1) / std::max(1, steps - 1);
        along(x.from_m, x.to_m, 10, [&](double s0, double s1) {
          for (int k = 0; k < steps; ++k)
            addBlock(s0, s1, side, x.offset_m + k * step_m, x.offset_m + (k + 1) * step_m, -kFoot_m,
                     1 + k * rise_m, Material::concrete);
        });
        return;
      }
      case SceneryKind::building:  // bays and pillars, as of garages
        along(x.from_m, x.to_m, 5, [&](double s0, double s1) {
          constexpr double kPillar_m = 0.8, kRecess_m = 0.6;
          addBlock(s0, s0 + kPillar_m, side, x.offset_m, x.offset_m + kRecess_m, -kFoot_m, x.height_m,
                   Material::concrete);
          addBlock(s0, s1, side, x.offset_m + kRecess_m, x.offset_m + std::max(x.depth_m, 2 * kRecess_m),
                   -kFoot_m, x.height_m, Material::cladding);
        });
        return;
      case SceneryKind::trees:
        along(x.from_m, x.to_m, 7, [&](double s0, double s1) { addTree(x, side, s0, s1); });
        return;
      case SceneryKind::gantry:
      case SceneryKind::overpass:
      case SceneryKind::tunnel:
        return;
    }
  }

  void addTree(const Scenery& x, Side side, double begin_m, double end_m) {
    const std::uint64_t k = 8 * x_trees++;
    const double s_m = begin_m + (end_m - begin_m) * x_noise.uniform(k);
    const double out_m = x.offset_m + x.depth_m * x_noise.uniform(k + 1);
    const double height_m = x.height_m * (0.6 + 0.4 * x_noise.uniform(k + 2));
    const double crown_m = 0.25 * height_m * (0.7 + 0.6 * x_noise.uniform(k + 3));
    const Vector3d foot = beside(s_m, side, out_m, -kFoot_m);
    constexpr int kSides = 6;
    const auto round = [&](int i, double radius_m, double above_m) {
      const double angle_rad = 2 * M_PI * i / kSides + 6 * x_noise.uniform(k + 4);
      return Vector3d(foot +
                      Vector3d(radius_m * std::cos(angle_rad), radius_m * std::sin(angle_rad), above_m));
    };
    const double trunk_m = 0.15 + 0.02 * height_m;
    const Vector3d top = foot + Vector3d(0, 0, kFoot_m + height_m),
                   bottom = foot + Vector3d(0, 0, kFoot_m + 0.25 * height_m);
    for (int i = 0; i < kSides; ++i) {
      x_mesh.quad(round(i, trunk_m, 0), round(i + 1, trunk_m, 0), round(i + 1, trunk_m, 0.5 * height_m),
                  round(i, trunk_m, 0.5 * height_m), Material::foliage);
      // A crown of two cones, base to base.
      const std::uint32_t a = x_mesh.vertex(round(i, crown_m, kFoot_m + 0.5 * height_m)),
                          b = x_mesh.vertex(round(i + 1, crown_m, kFoot_m + 0.5 * height_m));
      x_mesh.triangle(a, b, x_mesh.vertex(top), Material::foliage);
      x_mesh.triangle(a, b, x_mesh.vertex(bottom), Material::foliage);
    }
  }

  /** What spans the road: two supports and a deck. */
  void addAcross(const Scenery& x) {
    const bool is_tunnel = x.kind == SceneryKind::tunnel, is_gantry = x.kind == SceneryKind::gantry;
    if (!is_tunnel && !is_gantry && x.kind != SceneryKind::overpass) return;
    const double deck_m = is_gantry ? 1 : 1.5, support_m = is_gantry ? 0.5 : 1;
    const double to_m = is_gantry ? std::min(x.to_m, x.from_m + 1) : x.to_m;
    const Material material = is_gantry ? Material::metal : Material::concrete;
    along(x.from_m, to_m, 5, [&](double s0, double s1) {
      for (const Side side : {Side::left, Side::right})
        addBlock(s0, s1, side, x.offset_m, x.offset_m + support_m, -kFoot_m, x.height_m + deck_m, material);
      const auto corner = [&](double s_m, Side side, double above_m) {
        return beside(s_m, side, x.offset_m, x.height_m + above_m);
      };
      for (const double above_m : {0.0, deck_m})
        x_mesh.quad(corner(s0, Side::left, above_m), corner(s1, Side::left, above_m),
                    corner(s1, Side::right, above_m), corner(s0, Side::right, above_m), material);
      for (const double s_m : {s0, s1})
        x_mesh.quad(corner(s_m, Side::left, 0), corner(s_m, Side::left, deck_m),
                    corner(s_m, Side::right, deck_m), corner(s_m, Side::right, 0), material);
    });
  }

  /** A height field that is as high as the verges near them and passes below the road. */
  void addGround() {
    constexpr double kCell_m = 5, kControls_m = 10, kRough_m = 0.06;
    std::vector<Vector3d> controls;
    along(0, x_track.length_m(), kControls_m, [&](double s_m, double /*next*/) {
      for (const Side side : {Side::left, Side::right})
        controls.push_back(beside(s_m, side, verge_m(s_m, side), 0));
    });
    const HeightBlend blend(controls);
    const auto columns = static_cast<std::uint32_t>((blend.high().x() - blend.low().x()) / kCell_m) + 1;
    const auto rows = static_cast<std::uint32_t>((blend.high().y() - blend.low().y()) / kCell_m) + 1;
    constexpr auto kNone = std::numeric_limits<std::uint32_t>::max();
    std::vector<std::uint32_t> vertices(static_cast<std::size_t>(columns) * rows, kNone);
    for (std::uint32_t j = 0; j < rows; ++j)
      for (std::uint32_t i = 0; i < columns; ++i) {
        const double x_m = blend.low().x() + i * kCell_m, y_m = blend.low().y() + j * kCell_m;
        const auto height_m = blend.at(x_m, y_m);
        if (!height_m) continue;
        const std::size_t index = static_cast<std::size_t>(j) * columns + i;
        const double rough_m = kRough_m * (2 * x_noise.uniform((1ULL << 40) + index) - 1);
        vertices[index] = x_mesh.vertex(belowRoad({x_m, y_m, *height_m + rough_m}, kCell_m));
      }
    for (std::uint32_t j = 0; j + 1 < rows; ++j)
      for (std::uint32_t i = 0; i + 1 < columns; ++i) {
        const std::size_t index = static_cast<std::size_t>(j) * columns + i;
        const std::uint32_t a = vertices[index], b = vertices[index + 1], c = vertices[index + columns + 1],
                            d = vertices[index + columns];
        if (a != kNone && b != kNone && c != kNone && d != kNone) x_mesh.quad(a, b, c, d, Material::grass);
      }
  }

  /** A point of the ground, lowered where the road and its verges, and `margin_m` more, are above it. */
  [[nodiscard]] Vector3d belowRoad(Vector3d p_m, double margin_m) const {
    constexpr double kBelow_m = 1, kWidest_m = 60;
    const auto place = x_track.locate(p_m, kWidest_m);
    if (!place) return p_m;
    const RoadFrame frame = x_track.at(place->s_m);
    const double right_m = frame.right_m + verge_m(place->s_m, Side::right);
    const double left_m = frame.left_m + verge_m(place->s_m, Side::left);
    if (place->n_m < -right_m - margin_m || place->n_m > left_m + margin_m) return p_m;
    const Vector3d above = frame.T_map_road * Vector3d(0, std::clamp(place->n_m, -right_m, left_m), 0);
    p_m.z() = std::min(p_m.z(), above.z()) - kBelow_m;
    return p_m;
  }

  const Circuit& x_circuit;
  const Track& x_track;
  Noise x_noise;
  std::uint64_t x_trees = 0;
  Mesh x_mesh;
};

}  // namespace

Mesh sceneryMesh(const Circuit& circuit, std::uint64_t seed) { return Builder(circuit, seed).build(); }

}  // namespace raceloc
