/** \file
 * A command line, for a page. */
#pragma once

#include <string>
#include <vector>

namespace raceloc {

/** As a shell would take it: in single quotes where it needs them. */
[[nodiscard]] std::string commandText(const std::vector<std::string>& words);

}  // namespace raceloc
