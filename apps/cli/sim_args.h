/** \file
 * The command line of raceloc-sim. */
#pragma once

#include <optional>
#include <variant>

#include "cli/closed_loop_args.h"
#include "cli/inject.h"
#include "cli/simulate.h"

namespace raceloc {

struct PrintFaults {};  ///< every kind with its keys

using SimArgs = std::variant<SimulateArgs, InjectArgs, ClosedLoopArgs, PrintFaults>;

/** Empty after `--help` or `--version`. \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<SimArgs> parseSimArgs(int argc, char** argv);

/** Does what was asked, and prints what came of it. */
void runSim(const SimArgs& args);

}  // namespace raceloc
