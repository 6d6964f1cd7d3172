#pragma once

#include <cstdio>
#include <string>

namespace raceloc {

/** printf for what goes into cells and sentences. */
template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[512];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

/** With ten digits, and no more than it needs. */
inline std::string number(double value) { return format("%.10g", value); }

}  // namespace raceloc
