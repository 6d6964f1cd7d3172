#include "core/text_file.h"

namespace raceloc {

std::ifstream openText(const std::string& path) {
  constexpr int kMark = 0xEF,
                kMarkBytes = 3;  // EF BB BF; no text of ours begins with the letters U+F000 to U+FFFF
  std::ifstream in(path);
  if (in.peek() == kMark) in.ignore(kMarkBytes);
  return in;
}

}  // namespace raceloc
