#include "map/tile_query.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/errors.h"

namespace raceloc {

namespace {

/** Index of the tile at a coordinate, held within the range of int: no tile is beyond. */
int tileAt(double coordinate_m, double tile_size_m) {
  const double index = std::floor(coordinate_m / tile_size_m);
  constexpr double kLimit = std::numeric_limits<int>::max();
  return static_cast<int>(std::clamp(index, -kLimit, kLimit));
}

double requirePositive(double value, const char* what) {
  if (!(value > 0) || !std::isfinite(value))
    throw std::invalid_argument(std::string("TileWindow: bad ") + what);
  return value;
}

}  // namespace

TileWindow::TileWindow(gpu::Context& context, const MapFile& map, double voxel_size_m, double radius_m)
    : x_context(context),
      x_map(map),
      x_voxel_size_m(requirePositive(voxel_size_m, "voxel size")),
      x_radius_m(requirePositive(radius_m, "radius")),
      x_tile_size_m(map.info().tile_size_m),
      x_now{Eigen::Vector2d::Zero(), gpu::VoxelMap(context, voxel_size_m), {}, {}, {}} {}

bool TileWindow::moveTo(const Eigen::Vector2d& p_map_m) {
  if (!p_map_m.allFinite()) throw std::invalid_argument("TileWindow: the position is not finite");
  const double lead_m = 0.5 * x_tile_size_m;
  if (x_last_map_m) x_driven_m += (p_map_m - *x_last_map_m).norm();
  if (x_next.valid() && (x_driven_m >= lead_m || fromCentre(p_map_m) > x_tile_size_m)) useNext();
  if (!x_last_map_m || fromCentre(p_map_m) > x_tile_size_m) {
    ++x_waits;
    use(built(p_map_m));
  }
  if (!x_next.valid() && fromCentre(p_map_m) >= lead_m) {
    const Eigen::Vector2d ahead = (p_map_m - x_now.centre_map_m).normalized();
    x_next = std::async(
        std::launch::async | std::launch::deferred,
        [this, centre_map_m = Eigen::Vector2d(p_map_m + lead_m * ahead)] { return built(centre_map_m); });
    x_driven_m = 0;
  }
  x_last_map_m = p_map_m;
  x_degraded = anyNear(x_now.left_out, p_map_m);
  return anyNear(x_now.tiles, p_map_m);
}

std::vector<std::string> TileWindow::takeFaults() { return std::exchange(x_faults, {}); }

void TileWindow::useNext() {
  if (x_next.wait_for(std::chrono::seconds(0)) != std::future_status::ready) ++x_waits;
  use(x_next.get());
}

void TileWindow::use(Target target) {
  target.voxels.bringTo(x_context);
  x_faults.insert(x_faults.end(), target.faults.begin(), target.faults.end());
  x_now = std::move(target);
  ++x_rebuilds;
}

double TileWindow::fromCentre(const Eigen::Vector2d& p_map_m) const {
  return (p_map_m - x_now.centre_map_m).norm();
}

bool TileWindow::anyNear(const std::vector<TileIndex>& tiles, const Eigen::Vector2d& p_map_m) const {
  return std::any_of(tiles.begin(), tiles.end(), [&](const TileIndex& tile) {
    return distanceToTile(tile, x_tile_size_m, p_map_m) <= x_radius_m;
  });
}

std::vector<TileIndex> TileWindow::tilesWithin(double distance_m, const Eigen::Vector2d& p_map_m) const {
  const auto& all = x_map.tileIndices();  // ascending: column by column
  const int last_ix = tileAt(p_map_m.x() + distance_m, x_tile_size_m);
  const int first_iy = tileAt(p_map_m.y() - distance_m, x_tile_size_m);
  std::vector<TileIndex> found;
  auto next = std::lower_bound(all.begin(), all.end(),
                               TileIndex{tileAt(p_map_m.x() - distance_m, x_tile_size_m), first_iy});
  while (next != all.end() && next->first <= last_ix) {
    if (distanceToTile(*next, x_tile_size_m, p_map_m) <= distance_m) found.push_back(*next);
    ++next;
  }
  return found;
}

TileWindow::Target TileWindow::built(const Eigen::Vector2d& centre_map_m) {
  Target target{centre_map_m, gpu::VoxelMap(x_voxel_size_m), {}, {}, {}};
  std::map<TileIndex, Tile> points;
  for (const TileIndex& index : tilesWithin(x_radius_m + x_tile_size_m, centre_map_m)) {
    if (x_damaged.count(index) == 0) {
      try {
        const auto resident = x_points.find(index);
        points.emplace(index, resident != x_points.end() ? std::move(resident->second)
                                                         : x_map.tile(index.first, index.second).value());
      } catch (const InputError& damage) {  // a car on the track goes on with the tiles that are left
        x_damaged.insert(index);
        target.faults.emplace_back(damage.what());
      }
    }
    (x_damaged.count(index) == 0 ? target.tiles : target.left_out).push_back(index);
  }
  x_points.swap(points);
  for (const auto& [index, tile] : x_points) {
    gpu::Transform T_map_tile;
    const Eigen::Vector3d corner_m = tileCorner(tile, x_tile_size_m);
    T_map_tile.t = {corner_m.x(), corner_m.y(), corner_m.z()};
    const Cloud& cloud = tile.cloud;
    target.voxels.insert({cloud.x.data(), cloud.y.data(), cloud.z.data(), cloud.size()},
                         tile.covariances.view(), T_map_tile);
  }
  return target;
}

}  // namespace raceloc
