/** \file
 * How a gzip file says whether it is whole. */
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace raceloc {

/** Length of the plain data, modulo 2^32, as the last member of a gzip file states it in its trailer; empty
 * for a file that is no gzip file. Source: RFC 1952, ISIZE. */
[[nodiscard]] std::optional<std::uint32_t> statedGzipLength(const std::string& path);

}  // namespace raceloc
