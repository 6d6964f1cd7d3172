#include "eval/csv_columns.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/errors.h"
#include "core/text_file.h"

namespace raceloc {

namespace {

/** Without the carriage return of other systems. */
bool nextLine(std::istream& in, std::string& line) {
  if (!std::getline(in, line)) return false;
  if (!line.empty() && line.back() == '\r') line.pop_back();
  return true;
}

/** Fills `fields`, whose strings keep their memory from line to line. \return how many there are */
std::size_t splitInto(std::vector<std::string>& fields, const std::string& line) {
  std::size_t count = 0;
  const auto begin = [&] {
    if (++count > fields.size()) fields.emplace_back();
    fields[count - 1].clear();
  };
  begin();
  bool is_quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '"' && is_quoted && i + 1 < line.size() && line[i + 1] == '"') {
      fields[count - 1] += line[++i];
    } else if (c == '"') {
      is_quoted = !is_quoted;
    } else if (c == ',' && !is_quoted) {
      begin();
    } else {
      fields[count - 1] += c;
    }
  }
  return count;
}

bool parse(const std::string& text, double& value) {
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, value);
  return parsed.ec == std::errc() && parsed.ptr == end && !std::isnan(value);
}

/** A column that is wanted, and where it is. */
template <class Value>
struct Wanted {
  std::size_t field;
  const std::string* name;
  std::vector<Value>* values;
};

template <class Value>
std::vector<Wanted<Value>> placed(const std::vector<std::string>& names,
                                  const std::vector<std::string>& header,
                                  std::map<std::string, std::vector<Value>>& columns,
                                  const std::string& where) {
  std::vector<Wanted<Value>> wanted;
  for (const std::string& name : names) {
    const auto at = std::find(header.begin(), header.end(), name);
    if (at == header.end())
      throw InputError(where + ": no column " + name + " (columns in it: " + listed(header) + ")");
    wanted.push_back({static_cast<std::size_t>(at - header.begin()), &name, &columns[name]});
  }
  return wanted;
}

}  // namespace

CsvColumns readCsv(const std::string& what, const std::string& path, const std::vector<std::string>& numbers,
                   const std::vector<std::string>& words) {
  const std::string where = what + " " + path;
  std::ifstream in = openText(path);
  std::string line;
  if (!in || !nextLine(in, line)) throw InputError(where + ": cannot be read, or is empty; check the path");
  std::vector<std::string> header;
  splitInto(header, line);
  CsvColumns table;
  const auto number_columns = placed(numbers, header, table.numbers, where);
  const auto word_columns = placed(words, header, table.words, where);

  std::vector<std::string> fields;
  while (nextLine(in, line)) {
    ++table.lines;
    const auto here = [&] { return where + ", line " + std::to_string(table.lines + 1); };
    const std::size_t count = splitInto(fields, line);
    if (count != header.size())
      throw InputError(here() + ": " + std::to_string(count) + " fields under " +
                       std::to_string(header.size()) + " names; is the file cut off?");
    for (const auto& column : number_columns) {
      double value = 0;
      if (!parse(fields[column.field], value))
        throw InputError(here() + ": column " + *column.name + " is \"" + fields[column.field] +
                         "\", but it must be a number");
      column.values->push_back(value);
    }
    for (const auto& column : word_columns) column.values->push_back(fields[column.field]);
  }
  if (in.bad()) throw InputError(where + ": cannot be read to its end; check the disk");
  if (table.lines == 0) throw InputError(where + ": has no line below its header");
  return table;
}

bool hasCsvColumns(const std::string& path, const std::vector<std::string>& columns) {
  std::ifstream in = openText(path);
  std::string line;
  if (!in || !nextLine(in, line)) return false;
  std::vector<std::string> header;
  splitInto(header, line);
  return std::all_of(columns.begin(), columns.end(), [&](const std::string& name) {
    return std::find(header.begin(), header.end(), name) != header.end();
  });
}

}  // namespace raceloc
