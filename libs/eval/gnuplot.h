#pragma once

#include <string>

namespace raceloc {

/** What the program gnuplot draws by a script: the bytes of the picture, SVG or PNG as its terminal says. No display,
 * no settings of the user, nothing left behind.
 * \throws InputError if gnuplot is not installed or there is no room for temporary files. */
[[nodiscard]] std::string gnuplot(const std::string& script);

}  // namespace raceloc
