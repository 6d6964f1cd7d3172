#include "core/labels.h"

#include <fnmatch.h>

#include <algorithm>
#include <sstream>

namespace raceloc {

bool matchesLabel(const std::string& patterns, const std::string& label) {
  std::string blanks = patterns;
  std::replace(blanks.begin(), blanks.end(), ',', ' ');
  std::istringstream words(blanks);
  for (std::string pattern; words >> pattern;)
    if (fnmatch(pattern.c_str(), label.c_str(), 0) == 0) return true;
  return false;
}

}  // namespace raceloc
