#include "api/self_test.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <sstream>
#include <utility>

#include "api/deskew_job.hpp"
#include "api/voxel_table.hpp"
#include "core/se3_lm.hpp"

namespace raceloc::gpu {

namespace {

/** A room of 20 x 14 x 5 m with a block in it, sampled the same way on every machine. */
Points room(std::uint32_t seed, int n) {
  std::uint32_t state = seed;
  const auto uniform = [&state] {  // of a linear congruential generator, in [0, 1)
    state = 1664525U * state + 1013904223U;
    return static_cast<float>(state >> 8) / 16777216.0F;
  };
  Points p;
  for (int i = 0; i < n; ++i) {
    const float a = uniform(), b = uniform(), off_m = 0.01F * (uniform() - 0.5F);
    std::array<float, 3> q{};
    switch (i % 5) {
      case 0:
        q = {20 * a - 10, 14 * b - 7, off_m};
        break;
      case 1:
        q = {10 + off_m, 14 * a - 7, 5 * b};
        break;
      case 2:
        q = {20 * a - 10, 7 + off_m, 5 * b};
        break;
      case 3:
        q = {3 + off_m, 1 + 3 * a, 2 * b};
        break;
      default:
        q = {3 + 4 * a, 1 + off_m, 2 * b};
    }
    p.x.push_back(q[0] + 0.31F);  // no surface on the face of a voxel
    p.y.push_back(q[1] + 0.43F);
    p.z.push_back(q[2] + 0.37F);
  }
  return p;
}

/** The room seen in a sweep of 0.1 s by a sensor that moves 3 m and turns. */
Deskewed deskewedRoom(BackendBase& backend) {
  const Points scan = room(3, 4000);
  std::vector<float> time_s;
  for (std::size_t i = 0; i < scan.size(); ++i)
    time_s.push_back(0.1F * static_cast<float>(i) / static_cast<float>(scan.size()));
  const std::array<Affine, 3> T_end_lidar{Affine{0.995F, 0.1F, 0, -3, -0.1F, 0.995F, 0, 0.2F, 0, 0, 1, 1},
                                          Affine{0.999F, 0.05F, 0, -1.5F, -0.05F, 0.999F, 0, 0, 0, 0, 1, 1},
                                          Affine{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1}};
  const SweepView sweep{T_end_lidar.data(), T_end_lidar.size(), 0.1F};
  const std::vector<SweepStep> steps = sweepSteps(sweep, true);
  return backend.deskew(deskewJob(scan.view(), time_s.data(), sweep, steps, {}));
}

struct Result {
  Deskewed deskewed;
  Points thinned;
  Covariances covariances;
  StandingCells standing;
  std::vector<std::int32_t> clusters;
  Match match;
};

Transform guess() { return moved({}, {0.01, -0.01, 0.03, 0.25, -0.2, 0.1}); }

Result through(BackendBase& backend) {
  CovarianceOptions raw;
  raw.regularisation = Regularisation::none;
  const CovarianceOptions planes;
  Result result;
  result.deskewed = deskewedRoom(backend);
  std::size_t dropped = 0;
  result.thinned = backend.voxelGrid(room(1, 6000).view(), 0.25, dropped);
  const PointsView target = result.thinned.view();
  result.standing = backend.standingCells(target, {}, nullptr);
  result.clusters = backend.clusters(result.standing.face.view(), 0.6F);
  result.covariances = backend.covariances(target, raw);
  VoxelTable table(1.0);
  table.insert(target, backend.covariances(target, planes).view(), {});
  const auto mirror = backend.mirror();
  if (mirror) mirror->upload(table);
  const Points source = backend.voxelGrid(room(2, 4000).view(), 0.4, dropped);
  const Covariances C = backend.covariances(source.view(), planes);
  const MatchOptions options;
  result.match =
      gaussNewton(backend.passes(source.view(), C.view(), table, mirror.get(), options), guess(), options);
  return result;
}

/** NaN if there is one. */
template <class Values>
double largestDifference(const Values& a, const Values& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = std::fabs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
    if (std::isnan(difference)) return difference;
    largest = std::max(largest, difference);
  }
  return largest;
}

double distance_m(const Transform& A, const Transform& B) {
  return std::hypot(A.t[0] - B.t[0], A.t[1] - B.t[1], A.t[2] - B.t[2]);
}

std::string compare(const Result& here, const Result& cpu) {
  constexpr double covariance_m2 = 1e-4;  // of some 0.1: exponentials of 1e-6, sums in another order
  constexpr double pose_m = 1e-4, pose_rad = 1e-5;  // planes turn by 1e-3 where their normal is weak
  std::ostringstream text;
  const Points &moved = here.deskewed.points, &moved_there = cpu.deskewed.points;
  if (here.deskewed.indices != cpu.deskewed.indices || moved.x != moved_there.x || moved.y != moved_there.y ||
      moved.z != moved_there.z) {
    text << "its deskewed scan of " << moved.size() << " points is not the CPU's of " << moved_there.size();
    return text.str();
  }
  if (here.thinned.x != cpu.thinned.x || here.thinned.y != cpu.thinned.y || here.thinned.z != cpu.thinned.z) {
    text << "its voxel grid of " << here.thinned.size() << " points is not the CPU's of "
         << cpu.thinned.size();
    return text.str();
  }
  const Points &face = here.standing.face, &face_there = cpu.standing.face;
  if (face.x != face_there.x || face.y != face_there.y || face.z != face_there.z ||
      here.standing.lowest_m != cpu.standing.lowest_m || here.standing.highest_m != cpu.standing.highest_m)
    return "it does not find the CPU's standing cells";
  if (here.clusters != cpu.clusters) return "its clusters are not the CPU's";
  const Covariances &C = here.covariances, &D = cpu.covariances;
  if (C.neighbours != D.neighbours) return "it finds other neighbours than the CPU";
  for (const auto& [a, b] : {std::pair(&C.xx, &D.xx), std::pair(&C.xy, &D.xy), std::pair(&C.xz, &D.xz),
                             std::pair(&C.yy, &D.yy), std::pair(&C.yz, &D.yz), std::pair(&C.zz, &D.zz)}) {
    const double difference = largestDifference(*a, *b);
    if (difference <= covariance_m2) continue;  // not NaN
    text << "its covariances differ from the CPU's by up to " << difference << " m^2";
    return text.str();
  }
  const double moved_m = distance_m(here.match.T_map_source, guess());
  const double apart_m = distance_m(here.match.T_map_source, cpu.match.T_map_source);
  const double turned_rad = largestDifference(here.match.T_map_source.R, cpu.match.T_map_source.R);
  if (here.match.stop != cpu.match.stop) return "its match stops for another reason than the CPU's";
  if (moved_m < 0.1) return "its match gives the guess back";
  if (!(apart_m <= pose_m) || !(turned_rad <= pose_rad)) {
    text << "its pose is " << apart_m << " m and " << turned_rad << " rad from the CPU's";
    return text.str();
  }
  return {};
}

}  // namespace

std::string selfTest(BackendBase& device) {
  static const Result cpu = through(*makeCpuBackend(1));
  try {
    return compare(through(device), cpu);
  } catch (const DeviceError& error) {
    return error.what();
  }
}

}  // namespace raceloc::gpu
