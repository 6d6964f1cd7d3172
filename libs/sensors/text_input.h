/** \file
 * Reading the text files of foreign logs strictly. */
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raceloc {

/** The lines of a text file without line ends. \throws InputError "`what` `path`: cannot be read" */
[[nodiscard]] std::vector<std::string> readLines(const std::string& what, const std::string& path);

/** Parts between `delimiter`s, blanks and one pair of double quotes around each removed. With a blank as
 * delimiter, runs of blanks count once. */
[[nodiscard]] std::vector<std::string> split(std::string_view line, char delimiter);

/** The whole text as a finite number; empty otherwise. */
[[nodiscard]] std::optional<double> parseNumber(std::string_view text);

/** Exactly `count` numbers separated by blanks. \throws InputError "`where`: not N numbers: line" */
[[nodiscard]] std::vector<double> parseNumbers(const std::string& where, const std::string& line,
                                               std::size_t count);

/** Seconds since the epoch of `2025-09-05T00:27:38.589Z`; a blank may stand for the T, `+02:00` for the Z,
 * and without either it is UTC. Empty if it is no such time. */
[[nodiscard]] std::optional<double> parseCivilTime(std::string_view text);

}  // namespace raceloc
