/** \file
 * Options whose text is checked as strictly as a key of an ini file. */
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "cli/app.h"
#include "core/options.h"

namespace raceloc {

using Text = TCLAP::ValueArg<std::string>;

/** \name The value of an option. \throws InputError naming the option, what was given and what it must be
 * @{ */
[[nodiscard]] double numberOf(Text& option, const Range& range);
[[nodiscard]] int wholeNumberOf(Text& option, const Range& range);
[[nodiscard]] std::vector<double> numbersOf(Text& option, std::size_t count);
template <class Enum>
[[nodiscard]] Enum choiceOf(Text& option, const std::vector<std::pair<std::string, Enum>>& choices) {
  std::string allowed;
  for (const auto& [name, value] : choices) {
    if (name == option.getValue()) return value;
    allowed += (allowed.empty() ? "" : " | ") + name;
  }
  throw InputError("--" + option.getName() + " " + option.getValue() + ": must be " + allowed);
}
/** @} */

}  // namespace raceloc
