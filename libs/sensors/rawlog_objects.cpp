#include "sensors/rawlog_objects.h"

#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CObservation.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <filesystem>

#include "core/errors.h"

namespace raceloc {

namespace {

/** What MRPT says without its back trace. */
std::string firstLine(const std::string& text) {
  const auto begin = text.find_first_not_of(" \t\r\n=");
  return begin == std::string::npos ? text : text.substr(begin, text.find('\n', begin) - begin);
}

}  // namespace

RawlogObjects::RawlogObjects(const std::string& path)
    : x_path(path), x_file(std::make_unique<mrpt::io::CFileGZInputStream>()) {
  mrpt::maps::registerAllClasses_mrpt_maps();  // else the linker drops the point clouds, and reading stops at one
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
      if (!frame || frame->size() == 0) continue;
      x_frame.assign(frame->begin() + 1, frame->end());
      return *frame->begin();
    }
  } catch (const mrpt::serialization::CExceptionEOF&) {
    return nullptr;
  } catch (const std::exception& e) {
    throw InputError("rawlog " + x_path + ": truncated, damaged or of an unknown class after " +
                     std::to_string(x_objects) + " objects (" + firstLine(e.what()) +
                     "); cut it there with rawlog-edit, or record it again");
  }
}

double RawlogObjects::progress() const {
  const auto total = static_cast<double>(std::max<std::uint64_t>(1, x_file->getTotalBytesCount()));
  return std::min(1.0, static_cast<double>(x_file->getPosition()) / total);
}

}  // namespace raceloc
