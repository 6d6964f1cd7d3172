/** \file
 * The small tables of tests/golden. */
#pragma once

#include <sstream>
#include <string>
#include <vector>

#include "support/files.h"

namespace raceloc::test {

/** The last of `count` fields may hold commas. */
inline std::vector<std::string> fieldsOf(const std::string& line, std::size_t count) {
  std::vector<std::string> fields(1);
  for (const char c : line)
    if (c == ',' && fields.size() < count)
      fields.emplace_back();
    else
      fields.back() += c;
  return fields;
}

/** Lines of a CSV, without comments and the first. */
inline std::vector<std::vector<std::string>> rowsOf(const std::string& path, std::size_t fields) {
  std::istringstream text(readFile(path));
  std::vector<std::vector<std::string>> rows;
  for (std::string line; std::getline(text, line);)
    if (!line.empty() && line.front() != '#') rows.push_back(fieldsOf(line, fields));
  if (!rows.empty()) rows.erase(rows.begin());
  return rows;
}

}  // namespace raceloc::test
