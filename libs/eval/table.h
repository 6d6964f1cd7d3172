/** \file
 * A table of a report, for the terminal and for a page. */
#pragma once

#include <cstdio>
#include <string>
#include <vector>

namespace raceloc {

struct Table {
  std::string title;                           ///< of its section in a page
  std::vector<std::string> head;               ///< the first names the rows
  std::vector<std::vector<std::string>> rows;  ///< each as long as the head or shorter
  std::string note;                            ///< below it; empty: none
};

/** printf for what goes into cells and sentences. */
template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

/** Columns as wide as they need, numbers to the right; a line each. */
[[nodiscard]] std::string textTable(const Table& table);

/** With its title as a heading. */
[[nodiscard]] std::string htmlTable(const Table& table);

}  // namespace raceloc
