#include "api/voxel_table.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace raceloc::gpu {

namespace {

bool finite(const Sym3<double>& C) {
  return std::isfinite(C.xx) && std::isfinite(C.xy) && std::isfinite(C.xz) && std::isfinite(C.yy) &&
         std::isfinite(C.yz) && std::isfinite(C.zz);
}

}  // namespace

void VoxelTable::rehash(std::size_t expected_voxels) {
  std::int32_t bits = 6;
  while ((std::size_t{1} << bits) < 2 * expected_voxels) ++bits;
  x_shift = 64 - bits;
  x_slots.assign(std::size_t{1} << bits, VoxelSlot{});
  for (std::size_t i = 0; i < x_records.size(); ++i) enter(static_cast<std::int32_t>(i));
}

void VoxelTable::enter(std::int32_t record) {
  const std::uint64_t key = packedKey(x_records[static_cast<std::size_t>(record)].cell);
  const std::uint64_t mask = x_slots.size() - 1;
  std::uint64_t i = homeSlot(key, x_shift);
  while (x_slots[i].key != kNoKey) i = (i + 1) & mask;
  x_slots[i] = {key, record};
}

std::int32_t VoxelTable::findOrAdd(const Cell& cell) {
  const std::int32_t found = findRecord(view(), cell);
  if (found >= 0) return found;
  const auto added = static_cast<std::int32_t>(x_records.size());
  x_records.push_back({{0, 0, 0}, {0, 0, 0, 0, 0, 0}, cell});
  x_accumulators.emplace_back();
  if (2 * x_records.size() > x_slots.size()) {
    rehash(2 * x_records.size());
  } else {
    enter(added);
  }
  return added;
}

std::size_t VoxelTable::insert(const PointsView& points, const CovariancesView& covariances,
                               const Transform& T_map_points, Into into) {
  const auto& r = T_map_points.R;
  const Mat3<double> R{r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]};
  const Vec3<double> t{T_map_points.t[0], T_map_points.t[1], T_map_points.t[2]};
  std::size_t dropped = 0;
  x_touched.clear();
  ++x_insertions;
  for (std::size_t i = 0; i < points.size; ++i) {
    const Vec3<double> p = R * Vec3<double>{points.x[i], points.y[i], points.z[i]} + t;
    const Sym3<double> C = turned(R, Sym3<double>{covariances.xx[i], covariances.xy[i], covariances.xz[i],
                                                  covariances.yy[i], covariances.yz[i], covariances.zz[i]});
    Cell cell{};
    if (!cellOf(p.x, p.y, p.z, x_voxel_size_m, cell) || !finite(C)) {
      ++dropped;
      continue;
    }
    const std::int32_t record = findOrAdd(cell);
    Accumulator& sum = x_accumulators[static_cast<std::size_t>(record)];
    const bool touched_now = sum.last_insertion == x_insertions;
    if (into == Into::empty && sum.count > 0 && !touched_now) continue;
    sum.offset_m =
        sum.offset_m + Vec3<double>{p.x - centre(cell.x), p.y - centre(cell.y), p.z - centre(cell.z)};
    sum.covariance_m2 = sum.covariance_m2 + C;
    ++sum.count;
    if (!touched_now) x_touched.push_back(record);
    sum.last_insertion = x_insertions;
  }
  for (const std::int32_t i : x_touched) {
    Accumulator& sum = x_accumulators[static_cast<std::size_t>(i)];
    VoxelRecord& record = x_records[static_cast<std::size_t>(i)];
    const auto n = static_cast<double>(sum.count);
    const auto mean = [n](double total) { return static_cast<float>(total / n); };
    record.offset_m = {mean(sum.offset_m.x), mean(sum.offset_m.y), mean(sum.offset_m.z)};
    record.covariance_m2 = {mean(sum.covariance_m2.xx), mean(sum.covariance_m2.xy),
                            mean(sum.covariance_m2.xz), mean(sum.covariance_m2.yy),
                            mean(sum.covariance_m2.yz), mean(sum.covariance_m2.zz)};
  }
  return dropped;
}

/** \param keep called with a record and its accumulator */
template <class Keep>
std::size_t VoxelTable::keepIf(const Keep& keep) {
  const std::size_t before = x_records.size();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < before; ++i) {
    if (!keep(x_records[i], x_accumulators[i])) continue;
    x_records[kept] = x_records[i];
    x_accumulators[kept] = x_accumulators[i];
    ++kept;
  }
  x_records.resize(kept);
  x_accumulators.resize(kept);
  rehash(kept);
  return before - kept;
}

std::size_t VoxelTable::keepWithin(const std::array<double, 3>& centre_m, double distance_m) {
  return keepIf([&](const VoxelRecord& record, const Accumulator&) {
    const double dx = centre(record.cell.x) + static_cast<double>(record.offset_m.x) - centre_m[0];
    const double dy = centre(record.cell.y) + static_cast<double>(record.offset_m.y) - centre_m[1];
    const double dz = centre(record.cell.z) + static_cast<double>(record.offset_m.z) - centre_m[2];
    return dx * dx + dy * dy + dz * dz <= distance_m * distance_m;
  });
}

std::size_t VoxelTable::keepNewest(std::size_t voxels) {
  if (voxels >= x_records.size()) return 0;
  const auto byAge = [](const Accumulator& sum, const VoxelRecord& record) {
    return std::make_pair(-sum.last_insertion, packedKey(record.cell));
  };
  std::vector<std::pair<std::int64_t, std::uint64_t>> ages(x_records.size());
  for (std::size_t i = 0; i < ages.size(); ++i) ages[i] = byAge(x_accumulators[i], x_records[i]);
  const auto first_dropped = ages.begin() + static_cast<std::ptrdiff_t>(voxels);
  std::nth_element(ages.begin(), first_dropped, ages.end());
  return keepIf(
      [&](const VoxelRecord& record, const Accumulator& sum) { return byAge(sum, record) < *first_dropped; });
}

VoxelGaussians VoxelTable::contents() const {
  std::vector<std::size_t> order(x_records.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [this](std::size_t a, std::size_t b) {
    return packedKey(x_records[a].cell) < packedKey(x_records[b].cell);
  });
  VoxelGaussians out;
  for (const std::size_t i : order) {
    const VoxelRecord& record = x_records[i];
    const Accumulator& sum = x_accumulators[i];
    const auto n = static_cast<double>(sum.count);
    out.ix.push_back(record.cell.x);
    out.iy.push_back(record.cell.y);
    out.iz.push_back(record.cell.z);
    out.mean.x.push_back(static_cast<float>(centre(record.cell.x) + sum.offset_m.x / n));
    out.mean.y.push_back(static_cast<float>(centre(record.cell.y) + sum.offset_m.y / n));
    out.mean.z.push_back(static_cast<float>(centre(record.cell.z) + sum.offset_m.z / n));
    out.covariance.xx.push_back(record.covariance_m2.xx);
    out.covariance.xy.push_back(record.covariance_m2.xy);
    out.covariance.xz.push_back(record.covariance_m2.xz);
    out.covariance.yy.push_back(record.covariance_m2.yy);
    out.covariance.yz.push_back(record.covariance_m2.yz);
    out.covariance.zz.push_back(record.covariance_m2.zz);
    out.covariance.neighbours.push_back(static_cast<std::int32_t>(
        std::min<std::int64_t>(sum.count, std::numeric_limits<std::int32_t>::max())));
  }
  return out;
}

}  // namespace raceloc::gpu
