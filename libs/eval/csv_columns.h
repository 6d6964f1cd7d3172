/** \file
 * Tables of users and of raceloc-live. */
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace raceloc {

/** Columns by name, one value a line. */
struct CsvColumns {
  std::size_t lines = 0;
  std::map<std::string, std::vector<double>> numbers;
  std::map<std::string, std::vector<std::string>> words;
};

/** Reads columns that the first line names, in any order among others. Fields may be quoted as RFC 4180 has it, but hold no
 * line end.
 * \param what  the file to the user: "integrity"
 * \throws InputError naming file, line and column for: a file that cannot be read or has no line below the header, a column that
 * is not there, a line of another number of fields, a number that is none (inf is one, nan is not). */
[[nodiscard]] CsvColumns readCsv(const std::string& what, const std::string& path,
                                 const std::vector<std::string>& numbers,
                                 const std::vector<std::string>& words = {});

/** Whether the first line names all of the columns; false too for a file that cannot be read. */
[[nodiscard]] bool hasCsvColumns(const std::string& path, const std::vector<std::string>& columns);

}  // namespace raceloc
