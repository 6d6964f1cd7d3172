#include "core/options.h"

#include <mrpt/config/CConfigFileMemory.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <set>
#include <sstream>
#include <string_view>

#include "core/text_file.h"

namespace raceloc {

namespace {

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

std::string printable(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return std::isprint(c) == 0; }, '?');
  return text;
}

/** The value without a trailing comment and without blanks around it. The `//` of an url begins no comment. */
std::string bare(std::string text) {
  for (const char* mark : {"#", ";"}) text = text.substr(0, text.find(mark));
  auto slashes = text.find("//");
  while (slashes != std::string::npos && slashes > 0 && text[slashes - 1] == ':')
    slashes = text.find("//", slashes + 2);
  text = text.substr(0, slashes);
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

template <class Number>
bool parseWhole(const std::string& text, Number& number) {
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, number);
  return result.ec == std::errc() && result.ptr == end;
}

std::string shortest(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

std::string suggestion(const std::string& name, const std::vector<std::string>& known) {
  const std::string nearest = nearestName(name, known);
  return nearest.empty() ? " (known: " + listed(known) + ")" : "; did you mean " + nearest + "?";
}

}  // namespace

std::string nearestName(const std::string& name, const std::vector<std::string>& known) {
  std::string best;
  std::size_t best_edits = std::max<std::size_t>(2, name.size() / 2) + 1;
  for (const auto& candidate : known) {
    const std::size_t edits = editDistance(lower(name), lower(candidate));
    if (edits < best_edits) {
      best_edits = edits;
      best = candidate;
    }
  }
  return best;
}

bool Range::holds(double value) const {
  return std::isfinite(value) && (open_below ? value > low : value >= low) && value <= high;
}

std::string Range::text() const {
  if (std::isinf(low) && std::isinf(high)) return "any number";
  if (std::isinf(high)) return (open_below ? "> " : ">= ") + shortest(low);
  return shortest(low) + " .. " + shortest(high);
}

void OptionList::add(const std::string& key, double& member, const Range& range, const std::string& meaning) {
  bind({key, meaning, range.text(),
        [&member, range](const std::string& text) {
          double value = 0;
          if (!parseWhole(text, value) || !range.holds(value)) return false;
          member = value;
          return true;
        },
        [&member] { return shortest(member); }});
}

void OptionList::add(const std::string& key, int& member, const Range& range, const std::string& meaning) {
  bind({key, meaning, range.text() + ", whole",
        [&member, range](const std::string& text) {
          double value = 0;  // MRPT's $eval{} writes whole numbers with decimals
          if (!parseWhole(text, value) || !range.holds(value) || value != std::floor(value)) return false;
          if (std::abs(value) > std::numeric_limits<int>::max()) return false;
          member = static_cast<int>(value);
          return true;
        },
        [&member] { return std::to_string(member); }});
}

void OptionList::add(const std::string& key, bool& member, const std::string& meaning) {
  bind({key, meaning, "true | false",
        [&member](const std::string& text) {
          if (text != "true" && text != "false") return false;
          member = text == "true";
          return true;
        },
        [&member] { return std::string(member ? "true" : "false"); }});
}

void OptionList::add(const std::string& key, std::string& member, const std::string& meaning) {
  bind({key, meaning, "text", [&member](const std::string& text) { return member = text, true; },
        [&member] { return member; }});
}

void OptionList::atMost(const std::string& key, const double& member, const std::string& limit_key,
                        const double& limit) {
  for (Binding& b : x_bindings)
    if (b.key == key) b.allowed += ", at most " + limit_key;
  x_orders.push_back({key, limit_key, &member, &limit});
}

void OptionList::requireConsistent(const std::string& where) const {
  for (const auto& order : x_orders)
    if (*order.member > *order.limit)
      throw InputError(where + ": " + order.key + " = " + shortest(*order.member) +
                       ", but it must be at most " + order.limit_key + " = " + shortest(*order.limit));
}

std::string iniText(const std::string& section, OptionList& keys) {
  std::ostringstream out;
  out << "[" << section << "]\n";
  for (const auto& b : keys.x_bindings)
    out << "// " << b.meaning << "; " << b.allowed << "\n" << b.key << " = " << b.text() << "\n";
  return out.str();
}

IniFile::IniFile(const std::string& path) : x_path(path) {
  std::ifstream in = openText(path);
  std::string text;
  std::set<std::string> names;
  bool goes_on = false;  // the line before ends in a backslash
  int number = 0;
  for (std::string line; std::getline(in, line); text += line + "\n") {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    const auto first = line.find_first_not_of(" \t");
    const bool within = std::exchange(goes_on, !line.empty() && line.back() == '\\');
    if (within || first == std::string::npos) continue;
    if (line.compare(first, 2, "//") == 0) {
      line.clear();  // MRPT reads keys in "// a = b"
      continue;
    }
    if (std::string_view("#;@").find(line[first]) != std::string_view::npos) continue;
    if (const auto end = line.find(']', first); line[first] == '[' && end != std::string::npos) {
      const std::string name = line.substr(first + 1, end - first - 1);
      if (!names.insert(lower(name)).second)  // MRPT would merge them, silently
        throw InputError("ini " + path + ": section [" + name + "] is there twice; give one another name");
      continue;
    }
    const auto bad = [&](const std::string& what) {  // MRPT would pass over it, silently
      return InputError("ini " + path + ":" + std::to_string(number) + ": " + what + ": " +
                        printable(line.substr(first, 60)));
    };
    const auto equals = line.find('=', first);
    if (equals == std::string::npos || equals == first) throw bad("neither key = value nor [section]");
    if (names.empty()) throw bad("above the first [section]");
  }
  if (!in.eof()) throw InputError("ini " + path + ": cannot be read; check the path");
  try {
    x_file = std::make_unique<mrpt::config::CConfigFileMemory>(text);
  } catch (const std::exception& e) {  // MRPT's own syntax: ${X}, $eval{}
    const std::string reason = e.what();
    throw InputError("ini " + path + ": is no ini file (" +
                     printable(reason.substr(0, reason.find_first_of("\r\n"))) + ")");
  }
}

IniFile::~IniFile() = default;

void IniFile::read(const std::string& section, OptionList& keys) {
  std::vector<std::string> known;
  for (const auto& b : keys.x_bindings) known.push_back(b.key);

  for (const auto& pair : pairs(section)) {
    const std::string &name = pair.first, &value = pair.second;
    const auto binding = std::find_if(keys.x_bindings.begin(), keys.x_bindings.end(),
                                      [&](const auto& b) { return lower(b.key) == lower(name); });
    if (binding == keys.x_bindings.end())
      throw InputError("ini " + x_path + ", section [" + section + "]: unknown key " + name +
                       suggestion(name, known));
    if (!binding->read(value))
      throw InputError("ini " + x_path + ", section [" + section + "]: " + name + " = " + value +
                       ", but it must be " + binding->allowed);
  }
  keys.requireConsistent("ini " + x_path + ", section [" + section + "]");
}

std::vector<std::pair<std::string, std::string>> IniFile::pairs(const std::string& section) {
  x_known_sections.push_back(section);
  std::vector<std::string> names;
  x_file->getAllKeys(section, names);
  std::vector<std::pair<std::string, std::string>> found;
  found.reserve(names.size());
  for (const auto& name : names) found.emplace_back(name, bare(x_file->read_string(section, name, "")));
  return found;
}

std::vector<std::string> IniFile::sections(const std::string& prefix) const {
  std::vector<std::string> all, chosen;
  x_file->getAllSections(all);
  std::copy_if(all.begin(), all.end(), std::back_inserter(chosen), [&](const auto& name) {
    return !name.empty() && name.compare(0, prefix.size(), prefix) == 0;
  });
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

void IniFile::rejectUnknownSections() const {
  std::vector<std::string> sections;
  x_file->getAllSections(sections);
  for (const auto& section : sections) {
    const bool known = std::any_of(x_known_sections.begin(), x_known_sections.end(),
                                   [&](const auto& name) { return lower(name) == lower(section); });
    if (!section.empty() && !known)
      throw InputError("ini " + x_path + ": unknown section [" + section + "]" +
                       suggestion(section, x_known_sections));
  }
}

}  // namespace raceloc
