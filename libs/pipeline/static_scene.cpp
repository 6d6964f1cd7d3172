#include "pipeline/static_scene.h"

#include <tbb/parallel_invoke.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include "map/static_points.h"
#include "map/voxel_average.h"

namespace raceloc {

namespace {

/** Reads all scans in order; `look` has several of them at once, `take` what it made of them, in order, one by one. */
template <class Look, class Take>
void forEachScan(std::size_t scans, const ScanStore& store, int threads, const Look& look, const Take& take) {
  using KeyScan = std::pair<std::size_t, Cloud>;
  using Made = decltype(look(std::size_t{}, Cloud()));
  std::size_t next = 0, taken = 0;
  const auto read = [&](tbb::flow_control& flow) -> KeyScan {
    if (next == scans) {
      flow.stop();
      return {};
    }
    const std::size_t key = next++;
    return {key, store.scan(key)};
  };
  const auto made = [&](KeyScan scan) { return look(scan.first, std::move(scan.second)); };
  const auto done = [&](Made result) { take(std::move(result), ++taken); };
  tbb::task_arena(threads).execute([&] {
    tbb::parallel_pipeline(2 * static_cast<std::size_t>(threads),
                           tbb::make_filter<void, KeyScan>(tbb::filter_mode::serial_in_order, read) &
                               tbb::make_filter<KeyScan, Made>(tbb::filter_mode::parallel, made) &
                               tbb::make_filter<Made, void>(tbb::filter_mode::serial_in_order, done));
  });
}

}  // namespace

StaticScene staticScene(const SurveyedDrives& drives, const ScanStore& scans,
                        const std::vector<Pose>& T_map_body, const MapperOptions& options,
                        const StageProgress& progress) {
  const std::size_t keys = T_map_body.size();
  const int threads = options.matching.device.threads;
  const auto shareOf = [&](std::size_t taken) {
    return static_cast<double>(taken) / static_cast<double>(keys);
  };
  StaticVoxels still(options.static_points);
  forEachScan(
      keys, scans, threads, [&](std::size_t key, Cloud scan) { return std::make_pair(key, std::move(scan)); },
      [&](const std::pair<std::size_t, Cloud>& scan, std::size_t taken) {
        still.mark(scan.second, T_map_body[scan.first]);
        progress("occupied space", shareOf(taken));
      });
  still.endMarking();
  forEachScan(
      keys, scans, threads,
      [&](std::size_t key, const Cloud& scan) {
        const auto session = static_cast<std::size_t>(drives.session_of[key]);
        return still.look(scan, T_map_body[key], drives.surveys[session].p_body_eyes_m);
      },
      [&](const StaticVoxels::Seen& seen, std::size_t taken) {
        still.count(seen);
        progress("moving objects", shareOf(taken));
      });
  still.endCounting();
  VoxelAverage average(options.map.point_spacing_m);
  WallSharpness sharpness;
  std::size_t seen = 0, moving = 0;
  forEachScan(
      keys, scans, threads,
      [&](std::size_t key, const Cloud& whole) {
        return std::make_pair(whole.size(),
                              transformed(still.staticPart(whole, T_map_body[key]), T_map_body[key]));
      },
      [&](const std::pair<std::size_t, Cloud>& scan, std::size_t taken) {
        seen += scan.first;
        moving += scan.first - scan.second.size();
        tbb::parallel_invoke([&] { average.add(scan.second); }, [&] { sharpness.add(scan.second); });
        progress("points", shareOf(taken));
      });
  return {average.cloud(), sharpness.thickness(),
          seen > 0 ? static_cast<double>(moving) / static_cast<double>(seen) : 0};
}

TiledMap tilesOf(gpu::Context& context, const Cloud& points, const CovarianceOptions& covariance,
                 double tile_size_m) {
  std::map<std::pair<int, int>, std::vector<std::size_t>> within;  ///< tile or its margin
  std::map<std::pair<int, int>, std::vector<std::size_t>> own;
  const auto tileOf = [&](double x_m, double y_m) {
    return std::make_pair(static_cast<int>(std::floor(x_m / tile_size_m)),
                          static_cast<int>(std::floor(y_m / tile_size_m)));
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p = points.point(i).cast<double>();
    own[tileOf(p.x(), p.y())].push_back(i);
    const auto low = tileOf(p.x() - covariance.radius_m, p.y() - covariance.radius_m);
    const auto high = tileOf(p.x() + covariance.radius_m, p.y() + covariance.radius_m);
    for (int ix = low.first; ix <= high.first; ++ix)
      for (int iy = low.second; iy <= high.second; ++iy) within[{ix, iy}].push_back(i);
  }
  TiledMap map(tile_size_m);
  for (const auto& [tile, indices] : own) {
    // The tile's own points first: those are the ones that go into the map.
    std::vector<std::size_t> order = indices;
    std::set_difference(within[tile].begin(), within[tile].end(), indices.begin(), indices.end(),
                        std::back_inserter(order));
    Cloud around;
    around.reserve(order.size());
    const Eigen::Vector3d corner_m(tile.first * tile_size_m, tile.second * tile_size_m, 0);
    for (const std::size_t i : order) around.push((points.point(i).cast<double>() - corner_m).cast<float>());
    CovarianceCloud known = withCovariances(context, std::move(around), covariance);
    const std::size_t n = indices.size();
    for (auto* values : {&known.cloud.x, &known.cloud.y, &known.cloud.z}) values->resize(n);
    gpu::Covariances& c = known.covariances;
    for (auto* values : {&c.xx, &c.xy, &c.xz, &c.yy, &c.yz, &c.zz}) values->resize(n);
    c.neighbours.clear();
    map.insert(Tile{tile.first, tile.second, std::move(known.cloud), std::move(c)});
  }
  return map;
}

}  // namespace raceloc
