/** \file
 * A table of a report, for the terminal and for a page. */
#pragma once

#include <string>
#include <vector>

#include "eval/format.h"

namespace raceloc {

struct Table {
  std::string title;                           ///< of its section in a page
  std::vector<std::string> head;               ///< the first names the rows
  std::vector<std::vector<std::string>> rows;  ///< each as long as the head or shorter
  std::string note;                            ///< below it; empty: none
};

/** Columns as wide as they need, numbers to the right; a line each. */
[[nodiscard]] std::string textTable(const Table& table);

/** With its title as a heading. */
[[nodiscard]] std::string htmlTable(const Table& table);

}  // namespace raceloc
