/** \file
 * Options are structs with working defaults that list their keys once:
 * \code
 * struct GicpOptions {                       // section [registration]
 *   double voxel_size_m = 1.0;
 *   int max_iterations = 30;
 *   void describe(OptionList& keys) {
 *     keys.add("voxel_size_m", voxel_size_m, above(0), "edge of a target voxel [m]");
 *     keys.add("max_iterations", max_iterations, atLeast(1), "Gauss-Newton steps");
 *   }
 * };
 * GicpOptions gicp;
 * IniFile ini("ini/map.ini");
 * ini.load("registration", gicp);
 * ini.rejectUnknownSections();
 * \endcode
 * The list is read, range-checked and written back by one piece of code, because MRPT's own readers take a
 * bad number for 0 and a missing file for an empty one, silently. */
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/errors.h"

namespace mrpt::config {
class CConfigFileBase;
}

namespace raceloc {

/** Values that a numeric key may have; both ends inclusive unless `open_below`. */
struct Range {
  double low;
  double high;
  bool open_below = false;
  [[nodiscard]] bool holds(double value) const;
  [[nodiscard]] std::string text() const;  ///< "> 0", ">= 1", "0 .. 1"
};
[[nodiscard]] inline Range above(double low) { return {low, std::numeric_limits<double>::infinity(), true}; }
[[nodiscard]] inline Range atLeast(double low) { return {low, std::numeric_limits<double>::infinity()}; }
[[nodiscard]] inline Range between(double low, double high) { return {low, high}; }

/** The keys of one section, each bound to a member. */
class OptionList {
 public:
  void add(const std::string& key, double& member, const Range& range, const std::string& meaning);
  void add(const std::string& key, int& member, const Range& range, const std::string& meaning);
  void add(const std::string& key, bool& member, const std::string& meaning);
  void add(const std::string& key, std::string& member, const std::string& meaning);

  /** A name out of a fixed set. */
  template <class Enum>
  void add(const std::string& key, Enum& member, const std::vector<std::pair<std::string, Enum>>& choices,
           const std::string& meaning) {
    std::vector<std::string> names;
    names.reserve(choices.size());
    for (const auto& choice : choices) names.push_back(choice.first);
    std::string allowed;
    for (const auto& name : names) allowed += (allowed.empty() ? "" : " | ") + name;
    bind({key, meaning, allowed,
          [&member, choices](const std::string& text) {
            for (const auto& [name, value] : choices)
              if (name == text) return member = value, true;
            return false;
          },
          [&member, choices] {
            for (const auto& [name, value] : choices)
              if (value == member) return name;
            return std::string("?");
          }});
  }

  /** For values that only make sense together: the one of a key that is listed already is at most that of another. */
  void atMost(const std::string& key, const double& member, const std::string& limit_key,
              const double& limit);
  /** \param where  begins the message \throws InputError naming both keys if values contradict each other. */
  void requireConsistent(const std::string& where) const;

 private:
  friend class IniFile;
  friend std::string iniText(const std::string&, OptionList&);
  struct Binding {
    std::string key, meaning, allowed;
    std::function<bool(const std::string&)> read;  ///< false: not one of the allowed values
    std::function<std::string()> text;
  };
  struct Order {
    std::string key, limit_key;
    const double *member, *limit;
  };
  void bind(Binding binding) { x_bindings.push_back(std::move(binding)); }
  std::vector<Binding> x_bindings;
  std::vector<Order> x_orders;
};

/** The text of a section with every key, its value, meaning and range: how `--print-ini` and the shipped
 * files are written. */
[[nodiscard]] std::string iniText(const std::string& section, OptionList& keys);
template <class Options>
[[nodiscard]] std::string iniText(const std::string& section, Options options) {
  OptionList keys;
  options.describe(keys);
  return iniText(section, keys);
}

/** For options that perhaps no file told. \throws InputError as OptionList::requireConsistent() does. */
template <class Options>
void requireConsistent(const std::string& section, Options options) {
  OptionList keys;
  options.describe(keys);
  keys.requireConsistent("section [" + section + "]");
}

/** An ini file that is checked key by key. MRPT's syntax (`//`, `#`, `;` comments, `@define`, `$eval{}`). */
class IniFile {
 public:
  /** \throws InputError if the file cannot be read. */
  explicit IniFile(const std::string& path);
  ~IniFile();

  /** Fills `options` from `section` (absent section: defaults stay).
   * \throws InputError for an unknown key (with the nearest known one), a value that is not of the key's
   * type, one out of its range, or values that contradict each other. */
  template <class Options>
  void load(const std::string& section, Options& options) {
    OptionList keys;
    options.describe(keys);
    read(section, keys);
  }

  /** All `key = value` pairs of a free-form section, sorted by key: for column maps and the like. */
  [[nodiscard]] std::vector<std::pair<std::string, std::string>> pairs(const std::string& section);

  /** Names of the sections, sorted; `prefix` keeps those that begin with it. */
  [[nodiscard]] std::vector<std::string> sections(const std::string& prefix = "") const;

  [[nodiscard]] const std::string& path() const { return x_path; }

  /** \throws InputError if the file has a section that nobody loaded. Call it last. */
  void rejectUnknownSections() const;

 private:
  void read(const std::string& section, OptionList& keys);
  std::string x_path;
  std::unique_ptr<mrpt::config::CConfigFileBase> x_file;
  std::vector<std::string> x_known_sections;
};

/** The known name with the fewest edits to `name`; empty if none is near. */
[[nodiscard]] std::string nearestName(const std::string& name, const std::vector<std::string>& known);

}  // namespace raceloc
