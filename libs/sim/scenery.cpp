#include "sim/scenery.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace raceloc {

namespace {

using Eigen::Vector3d;

constexpr double kRow_m = 1.5;         // of the road and the walls
constexpr double kVerge_m = 6;         // beside the road where no wall says otherwise
constexpr double kBehindWall_m = 0.5;  // the verge goes on for this much
constexpr double kFoot_m = 1;          // how deep things stand in the ground

/** One side of the road: +1 left, -1 right. */
constexpr double signOf(Side side) { return side == Side::left ? 1 : -1; }

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
        const double steps = std::max(1.0, std::floor(x.depth_m / kStep_m));
        along(x.from_m, x.to_m, 10, [&](double s0, double s1) {
          for (double k = 0; k < steps; ++k)
            addBlock(s0, s1, side, x.offset_m + k * x.depth_m / steps,
                     x.offset_m + (k + 1) * x.depth_m / steps, -kFoot_m,
                     1 + (x.height_m - 1) * k / std::max(1.0, steps - 1), Material::concrete);
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
    constexpr double kCell_m = 5, kReach_m = 220, kControls_m = 10, kBelow_m = 1, kRough_m = 0.06;
    std::vector<Vector3d> controls;
    along(0, x_track.length_m(), kControls_m, [&](double s_m, double /*next*/) {
      for (const Side side : {Side::left, Side::right})
        controls.push_back(beside(s_m, side, verge_m(s_m, side), 0));
    });
    Vector3d low = controls.front(), high = controls.front();
    for (const auto& control : controls) {
      low = low.cwiseMin(control);
      high = high.cwiseMax(control);
    }
    const auto columns = static_cast<std::uint32_t>((high.x() - low.x() + 2 * kReach_m) / kCell_m) + 1;
    const auto rows = static_cast<std::uint32_t>((high.y() - low.y() + 2 * kReach_m) / kCell_m) + 1;
    constexpr auto kNone = std::numeric_limits<std::uint32_t>::max();
    std::vector<std::uint32_t> vertices(static_cast<std::size_t>(columns) * rows, kNone);
    for (std::uint32_t j = 0; j < rows; ++j)
      for (std::uint32_t i = 0; i < columns; ++i) {
        const double x_m = low.x() - kReach_m + i * kCell_m, y_m = low.y() - kReach_m + j * kCell_m;
        double weights = 0, sum = 0, nearest_m2 = std::numeric_limits<double>::infinity();
        for (const auto& control : controls) {
          const double d2 =
              (control.x() - x_m) * (control.x() - x_m) + (control.y() - y_m) * (control.y() - y_m);
          const double weight = 1 / (d2 * d2 + 1);
          weights += weight;
          sum += weight * control.z();
          nearest_m2 = std::min(nearest_m2, d2);
        }
        if (nearest_m2 > kReach_m * kReach_m) continue;
        const std::size_t index = static_cast<std::size_t>(j) * columns + i;
        double z_m = sum / weights + kRough_m * (2 * x_noise.uniform((1ULL << 40) + index) - 1);
        if (const auto place = x_track.locate({x_m, y_m, z_m}, 60)) {
          const RoadFrame frame = x_track.at(place->s_m);
          const double right_m = frame.right_m + verge_m(place->s_m, Side::right);
          const double left_m = frame.left_m + verge_m(place->s_m, Side::left);
          if (place->n_m > -right_m - kCell_m && place->n_m < left_m + kCell_m) {
            const double inside_m = std::clamp(place->n_m, -right_m, left_m);
            z_m = std::min(z_m, (frame.T_map_road * Vector3d(0, inside_m, 0)).z()) - kBelow_m;
          }
        }
        vertices[index] = x_mesh.vertex({x_m, y_m, z_m});
      }
    for (std::uint32_t j = 0; j + 1 < rows; ++j)
      for (std::uint32_t i = 0; i + 1 < columns; ++i) {
        const std::size_t index = static_cast<std::size_t>(j) * columns + i;
        const std::uint32_t a = vertices[index], b = vertices[index + 1], c = vertices[index + columns + 1],
                            d = vertices[index + columns];
        if (a != kNone && b != kNone && c != kNone && d != kNone) x_mesh.quad(a, b, c, d, Material::grass);
      }
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
