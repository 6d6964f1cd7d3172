/** \file
 * The observations of a rawlog file, one by one. */
#pragma once

#include <atomic>
#include <cstddef>
#include <exception>
#include <memory>
#include <string>
#include <thread>

#include "core/bounded_queue.h"

namespace mrpt::obs {
class CObservation;
}

namespace raceloc {

class PackedFile;

/** Reads object by object in constant memory, because CRawlog reads whole files and hides that one is
 * truncated. Observations inside a sensory frame come out like the others; actions are skipped. A thread of its own
 * unpacks a little ahead of next(). */
class RawlogObjects {
 public:
  /** \throws InputError if the file cannot be read. */
  explicit RawlogObjects(const std::string& path);
  ~RawlogObjects();
  RawlogObjects(const RawlogObjects&) = delete;
  RawlogObjects& operator=(const RawlogObjects&) = delete;

  /** The next observation, or null at the end of the file.
   * \throws InputError after how many objects the file turned out truncated, damaged, or of an unknown class.
   * Only an uncompressed file that is cut exactly between two objects passes for a whole one. */
  [[nodiscard]] std::shared_ptr<mrpt::obs::CObservation> next();
  [[nodiscard]] double progress() const;  ///< share of the file that is read, 0..1

 private:
  using Observation = std::shared_ptr<mrpt::obs::CObservation>;
  void readAhead();
  void requireObject() const;
  void requireWhole() const;

  std::string x_path;
  std::unique_ptr<PackedFile> x_file;  ///< this and x_objects: of the thread alone while it runs
  std::size_t x_objects = 0;
  std::atomic<double> x_progress = 0;
  BoundedQueue<Observation> x_queue{32};
  std::exception_ptr x_error;  ///< written before the queue is closed, read after it
  std::thread x_thread;
};

}  // namespace raceloc
