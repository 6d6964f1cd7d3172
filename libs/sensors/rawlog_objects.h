/** \file
 * The observations of a rawlog file, one by one. */
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <string>

namespace mrpt::obs {
class CObservation;
}

namespace raceloc {

class CountedFile;

/** Reads object by object in constant memory, because CRawlog reads whole files and hides that one is
 * truncated. Observations inside a sensory frame come out like the others; actions are skipped. */
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
  void requireWhole() const;
  std::string x_path;
  std::unique_ptr<CountedFile> x_file;
  std::deque<std::shared_ptr<mrpt::obs::CObservation>> x_frame;  ///< of the sensory frame read last
  std::size_t x_objects = 0;
};

}  // namespace raceloc
