#include "sim/world.h"

#include <embree3/rtcore.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace raceloc {

namespace {

constexpr std::size_t kPacket = 8;
constexpr float kNearest_m = 0.05F;

}  // namespace

struct World::Embree {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  ~Embree() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
};

World::World(const Mesh& mesh) : x_embree(std::make_unique<Embree>()) {
  // One instruction set: the same hits on any machine that has AVX2. No `threads=`, which would bind all of TBB.
  x_embree->device = rtcNewDevice("max_isa=avx2");
  if (x_embree->device == nullptr)
    throw std::runtime_error("Embree: no device, error " + std::to_string(rtcGetDeviceError(nullptr)));
  x_embree->scene = rtcNewScene(x_embree->device);
  rtcSetSceneFlags(x_embree->scene, RTC_SCENE_FLAG_ROBUST);  // no ray slips between two triangles

  const RTCGeometry geometry = rtcNewGeometry(x_embree->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                           sizeof(Eigen::Vector3f), mesh.vertices.size());
  void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                          3 * sizeof(std::uint32_t), mesh.triangles.size());
  if (vertices == nullptr || indices == nullptr) throw std::runtime_error("Embree: out of memory");
  std::copy(mesh.vertices.begin(), mesh.vertices.end(), static_cast<Eigen::Vector3f*>(vertices));
  std::copy(mesh.triangles.begin(), mesh.triangles.end(),
            static_cast<std::array<std::uint32_t, 3>*>(indices));
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(x_embree->scene, geometry);
  rtcReleaseGeometry(geometry);
  {  // One thread builds the tree, so that it is always the same.
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    rtcCommitScene(x_embree->scene);
  }
  const RTCError error = rtcGetDeviceError(x_embree->device);
  if (error != RTC_ERROR_NONE) throw std::runtime_error("Embree: error " + std::to_string(error));

  x_planes.reserve(mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& [ia, ib, ic] = mesh.triangles[i];
    const Eigen::Vector3d a = mesh.vertices[ia].cast<double>(), b = mesh.vertices[ib].cast<double>(),
                          c = mesh.vertices[ic].cast<double>();
    const Eigen::Vector3d normal = (b - a).cross(c - a).normalized();
    x_planes.push_back({normal, normal.dot(a), reflectivityOf(mesh.materials[i])});
  }
}

World::~World() = default;

void World::cast(const Eigen::Vector3d& origin_map_m, const Eigen::Vector3d* directions_map, std::size_t n,
                 double max_range_m, Hit* hits) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  const Eigen::Vector3f origin = origin_map_m.cast<float>();
  for (std::size_t first = 0; first < n; first += kPacket) {
    const std::size_t count = std::min(kPacket, n - first);
    alignas(32) RTCRayHit8 rays;
    alignas(32) int valid[kPacket];
    for (std::size_t k = 0; k < kPacket; ++k) {
      valid[k] = k < count ? -1 : 0;
      const Eigen::Vector3f direction = directions_map[first + std::min(k, count - 1)].cast<float>();
      rays.ray.org_x[k] = origin.x();
      rays.ray.org_y[k] = origin.y();
      rays.ray.org_z[k] = origin.z();
      rays.ray.dir_x[k] = direction.x();
      rays.ray.dir_y[k] = direction.y();
      rays.ray.dir_z[k] = direction.z();
      rays.ray.tnear[k] = kNearest_m;
      rays.ray.tfar[k] = static_cast<float>(max_range_m);
      rays.ray.time[k] = 0;
      rays.ray.mask[k] = std::numeric_limits<unsigned>::max();
      rays.ray.flags[k] = 0;
      rays.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
      rays.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect8(valid, x_embree->scene, &context, &rays);
    for (std::size_t k = 0; k < count; ++k) {
      Hit& hit = hits[first + k];
      hit = {};
      if (rays.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) continue;
      const Plane& plane = x_planes[rays.hit.primID[k]];
      const double slope = plane.normal.dot(directions_map[first + k]);
      if (slope == 0) continue;  // along the surface
      hit.range_m = (plane.offset_m - plane.normal.dot(origin_map_m)) / slope;
      hit.brightness = plane.reflectivity * static_cast<float>(std::abs(slope));
    }
  }
}

}  // namespace raceloc
