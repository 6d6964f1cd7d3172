/** \file
 * What MRPT says when it throws. */
#pragma once

#include <string>

namespace raceloc {

/** The line that matters of an exception's text, or of what a driver prints: no banner, no back trace. */
[[nodiscard]] inline std::string mrptMessage(const std::string& text) {
  const std::string tag = "Message:";
  const auto tagged = text.find(tag);
  const auto begin = text.find_first_not_of(" \t\r\n", tagged == std::string::npos ? 0 : tagged + tag.size());
  return begin == std::string::npos ? "" : text.substr(begin, text.find('\n', begin) - begin);
}

}  // namespace raceloc
