/** \file
 * Opening the text files of users. */
#pragma once

#include <fstream>
#include <string>

namespace raceloc {

/** A text file from its first line on: a UTF-8 byte-order mark, as spreadsheets write it, is passed over. Whether it
 * could be opened, the stream tells. */
[[nodiscard]] std::ifstream openText(const std::string& path);

}  // namespace raceloc
