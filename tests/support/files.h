/** \file
 * Whole files at once. */
#pragma once

#include <fstream>
#include <iterator>
#include <string>

namespace raceloc::test {

inline std::string readFile(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
inline void writeFile(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

}  // namespace raceloc::test
