/** \file
 * raceloc-live in the car: the clock, the sensors and the files around a run of the localizer. */
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "cli/live_args.h"
#include "pipeline/line_stream.h"

namespace raceloc {

/** Sends each output down a stream. \param stream null: nobody listens
 * \param now_s the time that the stamps' clock has now; empty: it has none */
[[nodiscard]] Listener streaming(LineStream* stream, const std::function<double()>& now_s);

/** Runs on sensors, or on a log at a given speed, until that ends or a signal wants it to. Records what came, and tells
 * how it does once a second. \param kept  gets the files that were written */
[[nodiscard]] ReplayReport runInCar(const LiveArgs& args, const ReplayOptions& options, LineStream* stream,
                                    const Listener& write, std::vector<std::string>& kept);

}  // namespace raceloc
