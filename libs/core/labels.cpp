#include "core/labels.h"

#include <fnmatch.h>

#include <algorithm>
#include <iterator>
#include <sstream>

namespace raceloc {

namespace {

std::vector<std::string> wordsOf(const std::string& patterns) {
  std::string blanks = patterns;
  std::replace(blanks.begin(), blanks.end(), ',', ' ');
  std::istringstream words(blanks);
  return {std::istream_iterator<std::string>(words), {}};
}

}  // namespace

bool matchesLabel(const std::string& patterns, const std::string& label) {
  const auto words = wordsOf(patterns);
  return std::any_of(words.begin(), words.end(), [&](const std::string& pattern) {
    return fnmatch(pattern.c_str(), label.c_str(), 0) == 0;
  });
}

std::vector<std::string> unmatchedPatterns(const std::string& patterns,
                                           const std::vector<std::string>& labels) {
  auto words = wordsOf(patterns);
  words.erase(std::remove_if(words.begin(), words.end(),
                             [&](const std::string& word) {
                               return std::any_of(labels.begin(), labels.end(), [&](const auto& label) {
                                 return matchesLabel(word, label);
                               });
                             }),
              words.end());
  return words;
}

std::vector<std::string> labelsNamed(const std::string& patterns) {
  auto words = wordsOf(patterns);
  words.erase(
      std::remove_if(words.begin(), words.end(),
                     [](const std::string& word) { return word.find_first_of("*?[") != std::string::npos; }),
      words.end());
  return words;
}

}  // namespace raceloc
