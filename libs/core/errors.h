/** \file
 * The one error that a user can cause and mend. */
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace raceloc {

/** Bad input from outside: the message names the file, the label or key, what was found instead, and
 * what to do. Apps print it as one line and exit with 2. A bug in our own code is never an InputError. */
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/** "a, b, c", or "none". */
[[nodiscard]] inline std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

}  // namespace raceloc
