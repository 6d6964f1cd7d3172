#include "sensors/gzip_length.h"

#include <array>
#include <fstream>

namespace raceloc {

std::optional<std::uint32_t> statedGzipLength(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (in.get() != 0x1f || in.get() != 0x8b) return std::nullopt;
  std::array<unsigned char, 4> trailer{};
  in.seekg(-4, std::ios::end);
  in.read(reinterpret_cast<char*>(trailer.data()), trailer.size());
  std::uint32_t length = 0;
  for (std::size_t i = 0; i < trailer.size(); ++i)
    length |= static_cast<std::uint32_t>(trailer[i]) << (8 * i);
  return length;
}

}  // namespace raceloc
