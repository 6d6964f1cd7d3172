/** \file
 * Triangles with what they are made of. */
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace raceloc {

enum class Material : std::uint8_t { asphalt, paint, concrete, metal, grass, foliage, cladding };

/** Share of the light that comes back from a surface seen squarely. Rounded from data sheets of LiDARs at 905 nm. */
[[nodiscard]] constexpr float reflectivityOf(Material material) {
  switch (material) {
    case Material::asphalt:
      return 0.12F;
    case Material::paint:
      return 0.6F;
    case Material::concrete:
      return 0.35F;
    case Material::metal:
      return 0.5F;
    case Material::grass:
      return 0.3F;
    case Material::foliage:
      return 0.4F;
    case Material::cladding:
      return 0.45F;
  }
  return 0;
}

/** Map frame [m]. Floats: 0.1 mm at 1 km from the origin. */
struct Mesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<Material> materials;  ///< of each triangle

  std::uint32_t vertex(const Eigen::Vector3d& p_map_m) {
    vertices.emplace_back(p_map_m.cast<float>());
    return static_cast<std::uint32_t>(vertices.size() - 1);
  }
  void triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c, Material material) {
    triangles.push_back({a, b, c});
    materials.push_back(material);
  }
  /** Corners in order round the edge. */
  void quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d, Material material) {
    triangle(a, b, c, material);
    triangle(a, c, d, material);
  }
  void quad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
            const Eigen::Vector3d& d, Material material) {
    const std::uint32_t ia = vertex(a), ib = vertex(b), ic = vertex(c), id = vertex(d);
    quad(ia, ib, ic, id, material);
  }
};

}  // namespace raceloc
