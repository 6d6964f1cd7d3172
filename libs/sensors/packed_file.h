/** \file
 * Files that may be packed with gzip, as MRPT's archives read them. */
#pragma once

#include <isa-l/igzip_lib.h>
#include <mrpt/io/CStream.h>

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

namespace raceloc {

/** Reads a file in order, unpacked: gzip of one or several members, or plain. MRPT's own reader takes twice as long
 * and does not tell a file that is cut from a whole one. */
class PackedFile : public mrpt::io::CStream {
 public:
  /** Whether it could be opened: good(). */
  explicit PackedFile(const std::string& path);
  [[nodiscard]] bool good() const { return x_good; }

  /** Fewer than `count` bytes only at the end of the file.
   * \throws std::runtime_error if what is packed is damaged, or reading fails */
  std::size_t Read(void* buffer, std::size_t count) override;
  /** The next byte that Read() will give; none at the end. \throws std::runtime_error as Read() does */
  [[nodiscard]] std::optional<std::uint8_t> peek();
  /** Whether the file ends within packed data; known at its end. */
  [[nodiscard]] bool isCut() const { return x_packed && x_inside; }

  std::uint64_t getTotalBytesCount() const override { return x_size; }  ///< of the file, packed
  std::uint64_t getPosition() const override { return x_read; }         ///< in it
  std::size_t Write(const void* buffer, std::size_t count) override;    ///< \throws std::logic_error
  std::uint64_t Seek(std::int64_t offset,
                     CStream::TSeekOrigin origin) override;  ///< \throws std::logic_error

 private:
  bool fill();    ///< x_out, with what comes next; false at the end
  bool refill();  ///< x_in
  bool unpack();

  std::ifstream x_file;
  bool x_good = false, x_packed = false;
  bool x_inside = false;  ///< a member has begun and has not ended
  std::uint64_t x_size = 0, x_read = 0;
  std::vector<std::uint8_t> x_in, x_out;
  std::size_t x_out_at = 0, x_out_end = 0;
  inflate_state x_state{};
};

}  // namespace raceloc
