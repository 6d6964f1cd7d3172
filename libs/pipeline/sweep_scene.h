/** \file
 * A sweep and what was made of it, as MRPT draws it. */
#pragma once

#include <mrpt/opengl/COpenGLScene.h>

#include "pipeline/localizer.h"

namespace raceloc {

/** Of an output with a scan match: car, scan, sources with 3-sigma ellipses, what stands beside the track by clusters, the
 * walls, the path along one, verdicts and guard as text. Axes as in the map, origin at the car: viewers look at the
 * origin, and there the car stays. */
[[nodiscard]] mrpt::opengl::COpenGLScene::Ptr sweepScene(const LocalizerOutput& output);

}  // namespace raceloc
