#include "sensors/text_input.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <ctime>

#include "core/errors.h"
#include "core/text_file.h"

namespace raceloc {

namespace {

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  text = text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
  return text.size() >= 2 && text.front() == '"' && text.back() == '"' ? text.substr(1, text.size() - 2)
                                                                       : text;
}

}  // namespace

std::vector<std::string> readLines(const std::string& what, const std::string& path) {
  std::ifstream in = openText(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    lines.push_back(line);
  }
  if (!in.eof()) throw InputError(what + " " + path + ": cannot be read; check the path");
  return lines;
}

std::vector<std::string> split(std::string_view line, char delimiter) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(delimiter, begin), line.size());
    const std::string_view part = trimmed(line.substr(begin, end - begin));
    if (delimiter != ' ' || !part.empty()) parts.emplace_back(part);
    begin = end + 1;
  }
  return parts;
}

std::optional<double> parseNumber(std::string_view text) {
  double value = 0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  if (result.ec != std::errc() || result.ptr != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

std::vector<double> parseNumbers(const std::string& where, const std::string& line, std::size_t count) {
  std::vector<double> numbers;
  for (const auto& part : split(line, ' ')) {
    const auto number = parseNumber(part);
    if (number) numbers.push_back(*number);
    if (!number || numbers.size() > count) {
      numbers.clear();
      break;
    }
  }
  if (numbers.size() != count)
    throw InputError(where + ": not " + std::to_string(count) + " numbers: " + line.substr(0, 80));
  return numbers;
}

std::optional<double> parseCivilTime(std::string_view text) {
  std::tm t{};
  int length = 0;
  char between = 0;
  const std::string copy(text);
  if (std::sscanf(copy.c_str(), "%4d-%2d-%2d%c%2d:%2d:%2d%n", &t.tm_year, &t.tm_mon, &t.tm_mday, &between,
                  &t.tm_hour, &t.tm_min, &t.tm_sec, &length) != 7 ||
      (between != 'T' && between != ' ') || t.tm_mon < 1 || t.tm_mon > 12 || t.tm_mday < 1 ||
      t.tm_mday > 31 || t.tm_hour > 23 || t.tm_min > 59 || t.tm_sec > 60)
    return std::nullopt;
  t.tm_year -= 1900;
  t.tm_mon -= 1;
  std::string_view rest = text.substr(static_cast<std::size_t>(length));

  double fraction_s = 0;
  if (!rest.empty() && rest.front() == '.') {
    const std::size_t end = std::min(rest.find_first_not_of("0123456789", 1), rest.size());
    const auto parsed = parseNumber("0" + std::string(rest.substr(0, end)));
    if (!parsed || end == 1) return std::nullopt;
    fraction_s = *parsed;
    rest.remove_prefix(end);
  }
  double zone_s = 0;
  if (rest.size() == 6 && (rest[0] == '+' || rest[0] == '-') && rest[3] == ':') {
    const auto hours = parseNumber(rest.substr(1, 2));
    const auto minutes = parseNumber(rest.substr(4, 2));
    if (!hours || !minutes) return std::nullopt;
    zone_s = (rest[0] == '+' ? 1 : -1) * (*hours * 3600 + *minutes * 60);
  } else if (!rest.empty() && rest != "Z") {
    return std::nullopt;
  }
  return static_cast<double>(timegm(&t)) - zone_s + fraction_s;
}

}  // namespace raceloc
