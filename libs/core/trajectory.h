/** \file
 * Trajectories and their exchange format: one line per pose, `stamp x y z qx qy qz qw` (TUM). */
#pragma once

#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "core/output_file.h"
#include "core/types.h"

namespace raceloc {

struct StampedPose {
  double stamp_s;
  Pose T_map_body;
};

/** Poses in order of time, all in one map frame. */
struct Trajectory {
  std::optional<GeodeticPoint> origin;  ///< of the map frame, when known
  std::vector<StampedPose> poses;
};

/** Writes a trajectory pose by pose, in constant memory; it appears under its name with commit() only.
 * Microseconds and 0.1 mm are exact; the origin goes into a comment line, which other TUM readers skip. */
class TumWriter {
 public:
  /** \param origin of the map frame, when known \throws InputError if the file cannot be written. */
  TumWriter(const std::string& path, const std::optional<GeodeticPoint>& origin);
  /** In order of time. \throws InputError if the disk is full, at the latest with commit(). */
  void write(const StampedPose& pose);
  /** \throws InputError if the disk is full or the file cannot be renamed. */
  void commit();
  [[nodiscard]] const std::string& path() const { return x_output.path(); }

 private:
  void requireGood() const;

  OutputFile x_output;
  std::ofstream x_file;
};

/** Poses that wait on disk until it is known what frame they are to be written in: in constant memory, beside the file
 * that they are for. They go when this does. */
class PoseSpool {
 public:
  /** \param path of the file that they are for \throws InputError if its folder cannot be written. */
  explicit PoseSpool(const std::string& path);
  /** \param pose  in the frame `odom` \throws InputError if the disk is full, at the latest with writeTo(). */
  void add(const StampedPose& pose);
  /** Writes T_map_odom times each, in the order in which they came; nothing is added after it.
   * \throws InputError as TumWriter::write() does, and if the disk was too full to keep them all. */
  void writeTo(TumWriter& writer, const Pose& T_map_odom);

 private:
  OutputFile x_output;  ///< never committed
  std::fstream x_file;
  std::size_t x_count = 0;
};

/** Writes a whole trajectory as TumWriter does. \throws InputError if the file cannot be written. */
void writeTum(const std::string& path, const Trajectory& trajectory);

/** \throws InputError naming file and line for: unreadable or empty file, a line without eight numbers,
 * stamps that do not increase, a quaternion off unit length by more than 1e-3. */
[[nodiscard]] Trajectory readTum(const std::string& path);

}  // namespace raceloc
