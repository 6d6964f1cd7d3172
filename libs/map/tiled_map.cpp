#include "map/tiled_map.h"

#include <cmath>
#include <stdexcept>
#include <utility>

namespace raceloc {

namespace {
constexpr double kFarthestTile = 1 << 20;
}

TiledMap::TiledMap(double tile_size_m) : x_tile_size_m(tile_size_m) {
  if (!(tile_size_m > 0) || !std::isfinite(tile_size_m))
    throw std::invalid_argument("TiledMap: the tile size must be finite and > 0");
}

void TiledMap::insert(const Cloud& cloud_map, const gpu::CovariancesView& covariances) {
  const std::size_t n = cloud_map.size();
  if (n == 0) return;
  const bool with_intensity = !cloud_map.intensity.empty();
  if (covariances.size != n || (with_intensity && cloud_map.intensity.size() != n))
    throw std::invalid_argument("TiledMap: points, covariances and intensities differ in number");
  if (!x_tiles.empty() && with_intensity == x_tiles.begin()->second.cloud.intensity.empty())
    throw std::invalid_argument("TiledMap: some clouds have intensities and some have none");
  const double farthest_m = kFarthestTile * x_tile_size_m;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3f p = cloud_map.point(i);
    if (!p.allFinite() || !(p.head<2>().cwiseAbs().maxCoeff() < farthest_m))
      throw std::invalid_argument("TiledMap: a point is not finite or too far away");
  }

  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d p_map_m = cloud_map.point(i).cast<double>();
    const int ix = static_cast<int>(std::floor(p_map_m.x() / x_tile_size_m));
    const int iy = static_cast<int>(std::floor(p_map_m.y() / x_tile_size_m));
    Tile& tile = x_tiles.try_emplace({ix, iy}, Tile{ix, iy, {}, {}}).first->second;
    tile.cloud.push((p_map_m - tileCorner(tile, x_tile_size_m)).cast<float>());
    if (with_intensity) tile.cloud.intensity.push_back(cloud_map.intensity[i]);
    gpu::Covariances& c = tile.covariances;
    c.xx.push_back(covariances.xx[i]);
    c.xy.push_back(covariances.xy[i]);
    c.xz.push_back(covariances.xz[i]);
    c.yy.push_back(covariances.yy[i]);
    c.yz.push_back(covariances.yz[i]);
    c.zz.push_back(covariances.zz[i]);
  }
  x_points += n;
}

void TiledMap::insert(Tile&& tile) {
  const std::pair place{tile.ix, tile.iy};
  const std::size_t points = tile.cloud.size();
  if (!x_tiles.try_emplace(place, std::move(tile)).second)
    throw std::invalid_argument("TiledMap: a tile that is there already");
  x_points += points;
}

}  // namespace raceloc
