/** \file
 * The triangles of a circuit. */
#pragma once

#include "sim/mesh.h"
#include "sim/noise.h"
#include "track/circuit.h"

namespace raceloc {

/** Road with its painted edges, kerbs, verges, walls, catch-fences, what stands beside the track, and the ground around
 * it, which blends the heights of the verges.
 * \param seed  of what is scattered: trees, and the roughness of the ground */
[[nodiscard]] Mesh sceneryMesh(const Circuit& circuit, std::uint64_t seed);

}  // namespace raceloc
