#pragma once

#include <string>
#include <vector>

namespace raceloc {

/** The numbers of a line, between blanks, commas or semicolons; none at all if one of them is no finite number. */
[[nodiscard]] std::vector<double> numbersIn(const std::string& line);

}  // namespace raceloc
