#include "sensors/rawlog_objects.h"

#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CObservation.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <cstdint>
#include <new>

#include "core/errors.h"
#include "sensors/mrpt_message.h"
#include "sensors/packed_file.h"

namespace raceloc {

RawlogObjects::RawlogObjects(const std::string& path)
    : x_path(path), x_file(std::make_unique<PackedFile>(path)) {
  mrpt::maps::registerAllClasses_mrpt_maps();  // else the linker drops the point clouds, and reading stops at
                                               // one
  if (!x_file->good()) throw InputError("rawlog " + path + ": cannot be read; check the path");
  x_thread = std::thread([this] {
    try {
      readAhead();
    } catch (...) {
      x_error = std::current_exception();
    }
    x_queue.close();
  });
}

RawlogObjects::~RawlogObjects() {
  x_queue.close();
  x_thread.join();
}

std::shared_ptr<mrpt::obs::CObservation> RawlogObjects::next() {
  if (auto observation = x_queue.pop()) return std::move(*observation);
  if (x_error) std::rethrow_exception(x_error);
  return nullptr;
}

void RawlogObjects::readAhead() {
  const auto total = static_cast<double>(std::max<std::uint64_t>(1, x_file->getTotalBytesCount()));
  auto archive = mrpt::serialization::archiveFrom(*x_file);
  try {
    requireObject();
    for (;;) {
      const auto object = archive.ReadObject();
      ++x_objects;
      x_progress = std::min(1.0, static_cast<double>(x_file->getPosition()) / total);
      if (auto observation = std::dynamic_pointer_cast<mrpt::obs::CObservation>(object)) {
        if (!x_queue.push(std::move(observation))) return;
      } else if (const auto frame = std::dynamic_pointer_cast<mrpt::obs::CSensoryFrame>(object)) {
        for (const auto& in_frame : *frame)
          if (!x_queue.push(in_frame)) return;
      }
    }
  } catch (const mrpt::serialization::CExceptionEOF&) {
    requireWhole();
  } catch (const InputError&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    throw InputError("rawlog " + x_path + ": truncated, damaged or of an unknown class after " +
                     std::to_string(x_objects) + " objects (" + mrptMessage(e.what()) +
                     "); cut it there with rawlog-edit, or record it again");
  }
}

void RawlogObjects::requireObject() const {
  constexpr std::uint8_t kObject =
      0x80;  // what MRPT adds to the length of a class name, with which objects begin
  if (const auto first = x_file->peek(); first && *first < kObject)
    throw InputError(
        "rawlog " + x_path +
        ": not a rawlog (no object of MRPT at its start); raceloc-import makes one of other recordings");
}

double RawlogObjects::progress() const { return x_progress; }

void RawlogObjects::requireWhole() const {
  if (x_file->isCut())
    throw InputError("rawlog " + x_path + ": truncated after " + std::to_string(x_objects) +
                     " objects; record it again");
}

}  // namespace raceloc
