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

}  // namespace raceloc
