#include "map/bytes.h"

#include <mrpt/system/md5.h>

namespace raceloc {

std::string md5Of(const Bytes& bytes) {
  constexpr unsigned char kNothing = 0;  // MRPT takes no null pointer, not even with no bytes behind it
  return mrpt::system::md5(bytes.empty() ? &kNothing : reinterpret_cast<const unsigned char*>(bytes.data()),
                           bytes.size());
}

}  // namespace raceloc
