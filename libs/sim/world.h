/** \file
 * What a LiDAR can hit, and rays through it (Embree). */
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "sim/mesh.h"

namespace raceloc {

/** What a ray met. */
struct Hit {
  double range_m = 0;    ///< 0: nothing
  float brightness = 0;  ///< reflectivity times the cosine of the angle of incidence, 0..1
};

/** Never changes; cast() may be called by many threads. */
class World {
 public:
  explicit World(const Mesh& mesh);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /** The first surface along each of `n` rays from one point.
   * \param directions_map  of unit length, up to 1e-6
   * \param hits            n of them; ranges are exact (double) for the triangle that was hit */
  void cast(const Eigen::Vector3d& origin_map_m, const Eigen::Vector3d* directions_map, std::size_t n,
            double max_range_m, Hit* hits) const;

 private:
  struct Plane {  // of a triangle: normal . p = offset
    Eigen::Vector3d normal;
    double offset_m;
    float reflectivity;
  };
  struct Embree;
  std::unique_ptr<Embree> x_embree;
  std::vector<Plane> x_planes;
};

}  // namespace raceloc
