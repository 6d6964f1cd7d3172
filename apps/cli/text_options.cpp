#include "cli/text_options.h"

#include <cmath>

#include "core/errors.h"
#include "sensors/text_input.h"

namespace raceloc {

double numberOf(Text& option, const Range& range) {
  const auto number = parseNumber(option.getValue());
  if (!number || !range.holds(*number))
    throw InputError("--" + option.getName() + " " + option.getValue() + ": must be a number " +
                     range.text());
  return *number;
}

int wholeNumberOf(Text& option, const Range& range) {
  const double number = numberOf(option, range);
  if (number != std::floor(number))
    throw InputError("--" + option.getName() + " " + option.getValue() + ": must be a whole number");
  return static_cast<int>(number);
}

std::vector<double> numbersOf(Text& option, std::size_t count) {
  return parseNumbers("--" + option.getName(), option.getValue(), count);
}

}  // namespace raceloc
