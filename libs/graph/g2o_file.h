/** \file
 * Pose graphs as g2o text files, for other programs and from public data. */
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "graph/pose_graph.h"

namespace raceloc {

/** Reads VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX, their planar kin VERTEX_SE2 and EDGE_SE2, and the older names of
 * TORO (VERTEX3, EDGE3 with roll, pitch, yaw; VERTEX2, EDGE2). Keys are numbered in the order in which the file
 * first names them.
 * - An information matrix is taken as that of (translation [m], rotation vector [rad]), as GTSAM does: g2o itself
 *   halves the rotation.
 * - TORO's is that of (translation, roll, pitch, yaw), or missing (unit); it is turned into that of g2o's
 *   quaternion first, as it is when such a file is converted, so that both have the same chi-square.
 * - A pose without a vertex line starts where the first edge that reaches it puts it.
 * - Planar graphs lie at z = 0; what the plane does not measure (z, roll, pitch) has unit information.
 * - `held` is the pose of the FIX line, else the first.
 * \throws InputError naming file and line for anything else. */
[[nodiscard]] PoseGraph readG2o(const std::string& path);

/** An edge as the format has it. */
struct G2oEdge {
  std::size_t i, j;
  Pose T_i_j;
  Matrix6d information;  ///< of its right increment: rotation [1/rad^2], then translation [1/m^2]
};

/** Writes VERTEX_SE3:QUAT of every pose, FIX of the held one, EDGE_SE3:QUAT of every edge with the information of
 * (translation, rotation vector). \throws InputError if the file cannot be written. */
void writeG2o(const std::string& path, const std::vector<Pose>& poses, std::optional<std::size_t> held,
              const std::vector<G2oEdge>& edges);

/** Writes poses, the held one and all between factors, without their losses. \return how many other factors
 * were left out, because the format has none like them. \throws InputError if the file cannot be written. */
std::size_t writeG2o(const std::string& path, const PoseGraph& graph);

}  // namespace raceloc
