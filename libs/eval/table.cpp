#include "eval/table.h"

#include <algorithm>

#include "eval/html.h"

namespace raceloc {

namespace {

constexpr std::size_t kFirst = 20, kOthers = 10;  // least widths

}  // namespace

std::string textTable(const Table& table) {
  std::vector<std::size_t> widths;
  const auto measure = [&](const std::vector<std::string>& cells) {
    for (std::size_t k = 0; k < cells.size(); ++k) {
      if (k == widths.size()) widths.push_back(k == 0 ? kFirst : kOthers);
      widths[k] = std::max(widths[k], cells[k].size());
    }
  };
  measure(table.head);
  for (const auto& row : table.rows) measure(row);
  std::string text;
  const auto write = [&](const std::vector<std::string>& cells) {
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const std::string padding(widths[k] - cells[k].size(), ' ');
      text += k == 0 ? cells[k] + padding : " " + padding + cells[k];
    }
    text += "\n";
  };
  write(table.head);
  for (const auto& row : table.rows) write(row);
  if (!table.note.empty()) text += "(" + table.note + ")\n";
  return text;
}

std::string htmlTable(const Table& table) {
  std::string html = "<h2>" + escaped(table.title) + "</h2>\n<table>\n" + htmlRow("th", table.head);
  for (const auto& row : table.rows) html += htmlRow("td", row);
  html += "</table>\n";
  if (!table.note.empty()) html += "<p class=\"note\">" + escaped(table.note) + "</p>\n";
  return html;
}

}  // namespace raceloc
