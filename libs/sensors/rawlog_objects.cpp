#include "sensors/rawlog_objects.h"

#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CObservation.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>

#include "core/errors.h"
#include "sensors/gzip_length.h"

namespace raceloc {

/** Counts the bytes after decompression. */
class CountedFile : public mrpt::io::CFileGZInputStream {
 public:
  std::size_t Read(void* buffer, std::size_t count) override {
    const std::size_t got = CFileGZInputStream::Read(buffer, count);
    if (got <= count) x_bytes += got;
    return got;
  }
  [[nodiscard]] std::uint64_t bytes() const { return x_bytes; }

 private:
  std::uint64_t x_bytes = 0;
};

namespace {

/** What MRPT says, without its banner and back trace. */
std::string messageOf(const std::exception& e) {
  const std::string text = e.what();
  const std::string tag = "Message:";
  const auto tagged = text.find(tag);
  const auto begin = text.find_first_not_of(" \t\r\n", tagged == std::string::npos ? 0 : tagged + tag.size());
  return begin == std::string::npos ? "" : text.substr(begin, text.find('\n', begin) - begin);
}

}  // namespace

RawlogObjects::RawlogObjects(const std::string& path)
    : x_path(path), x_file(std::make_unique<CountedFile>()) {
  mrpt::maps::registerAllClasses_mrpt_maps();  // else the linker drops the point clouds, and reading stops at
                                               // one
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored) || !x_file->open(path))
    throw InputError("rawlog " + path + ": cannot be read; check the path");
}

RawlogObjects::~RawlogObjects() = default;

std::shared_ptr<mrpt::obs::CObservation> RawlogObjects::next() {
  if (!x_frame.empty()) {
    auto observation = x_frame.front();
    x_frame.pop_front();
    return observation;
  }
  auto archive = mrpt::serialization::archiveFrom(*x_file);
  try {
    for (;;) {
      const auto object = archive.ReadObject();
      ++x_objects;
      if (auto observation = std::dynamic_pointer_cast<mrpt::obs::CObservation>(object)) return observation;
      const auto frame = std::dynamic_pointer_cast<mrpt::obs::CSensoryFrame>(object);
      if (!frame || frame->begin() == frame->end()) continue;
      x_frame.assign(frame->begin() + 1, frame->end());
      return *frame->begin();
    }
  } catch (const mrpt::serialization::CExceptionEOF&) {
    requireWhole();
    return nullptr;
  } catch (const std::exception& e) {
    throw InputError("rawlog " + x_path + ": truncated, damaged or of an unknown class after " +
                     std::to_string(x_objects) + " objects (" + messageOf(e) +
                     "); cut it there with rawlog-edit, or record it again");
  }
}

void RawlogObjects::requireWhole() const {
  // A gzip file that is cut ends like a whole one as far as MRPT tells; the length in its trailer does not
  // fit.
  const auto stated = statedGzipLength(x_path);
  if (stated && *stated != static_cast<std::uint32_t>(x_file->bytes()))
    throw InputError(
        "rawlog " + x_path + ": truncated after " + std::to_string(x_objects) +
        " objects; record it again, or if it was put together of several gzip files, unpack it first");
}

double RawlogObjects::progress() const {
  const auto total = static_cast<double>(std::max<std::uint64_t>(1, x_file->getTotalBytesCount()));
  return std::min(1.0, static_cast<double>(x_file->getPosition()) / total);
}

}  // namespace raceloc
