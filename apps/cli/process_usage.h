/** \file
 * What a command costs, taken from the operating system. */
#pragma once

#include <string>
#include <vector>

#include "cli/usage_log.h"

namespace raceloc {

/** Runs a command to its end, with the standard streams and the environment of this process, and looks at it and its
 * children once a period. Ctrl-C at the terminal is the command's own business; a SIGINT or SIGTERM that is sent to this
 * process is handed on.
 * \param command   the program, as a shell would find it, and its arguments; at least one word
 * \param period_s  > 0
 * \throws InputError if it cannot be started.
 * Source: proc(5), clock_getcpuclockid(3), wait4(2). */
[[nodiscard]] ProcessUsage runMeasured(const std::vector<std::string>& command, double period_s);

}  // namespace raceloc
