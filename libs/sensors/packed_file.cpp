#include "sensors/packed_file.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace raceloc {

namespace {

constexpr std::size_t kBuffer = std::size_t{1} << 18U;

}  // namespace

PackedFile::PackedFile(const std::string& path) : x_in(kBuffer), x_out(kBuffer) {
  std::error_code unreadable;
  x_size = std::filesystem::file_size(path, unreadable);
  if (unreadable || !std::filesystem::is_regular_file(path, unreadable)) return;
  x_file.open(path, std::ios::binary);
  x_good = x_file.is_open();
  if (!x_good) return;
  isal_inflate_init(&x_state);
  x_state.crc_flag = ISAL_GZIP;
  x_packed = refill() && x_state.avail_in >= 2 && x_in[0] == 0x1f && x_in[1] == 0x8b;
}

bool PackedFile::refill() {
  x_file.read(reinterpret_cast<char*>(x_in.data()), static_cast<std::streamsize>(x_in.size()));
  if (x_file.bad()) throw std::runtime_error("the disk does not give it");
  const auto got = static_cast<std::size_t>(x_file.gcount());
  x_read += got;
  x_state.next_in = x_in.data();
  x_state.avail_in = static_cast<std::uint32_t>(got);
  return got > 0;
}

bool PackedFile::unpack() {
  for (;;) {
    if (x_state.avail_in == 0 && !refill()) return false;
    if (!x_inside) {
      isal_inflate_reset(&x_state);
      x_inside = true;
    }
    x_state.next_out = x_out.data();
    x_state.avail_out = static_cast<std::uint32_t>(x_out.size());
    if (isal_inflate(&x_state) != ISAL_DECOMP_OK) throw std::runtime_error("its packed data is damaged");
    if (x_state.block_state == ISAL_BLOCK_FINISH) x_inside = false;
    x_out_end = x_out.size() - x_state.avail_out;
    if (x_out_end > 0) return true;
  }
}

bool PackedFile::fill() {
  x_out_at = x_out_end = 0;
  if (x_packed) return unpack();
  if (x_state.avail_in == 0 && !refill()) return false;
  std::swap(x_in, x_out);
  x_out_end = x_state.avail_in;
  x_state.avail_in = 0;
  return true;
}

std::optional<std::uint8_t> PackedFile::peek() {
  if (x_out_at == x_out_end && !fill()) return std::nullopt;
  return x_out[x_out_at];
}

std::size_t PackedFile::Read(void* buffer, std::size_t count) {
  std::size_t done = 0;
  while (done < count && (x_out_at < x_out_end || fill())) {
    const std::size_t n = std::min(count - done, x_out_end - x_out_at);
    std::memcpy(static_cast<std::uint8_t*>(buffer) + done, x_out.data() + x_out_at, n);
    x_out_at += n;
    done += n;
  }
  return done;
}

std::size_t PackedFile::Write(const void* /*buffer*/, std::size_t /*count*/) {
  throw std::logic_error("PackedFile: reads only");
}

std::uint64_t PackedFile::Seek(std::int64_t /*offset*/, CStream::TSeekOrigin /*origin*/) {
  throw std::logic_error("PackedFile: reads in order only");
}

}  // namespace raceloc
