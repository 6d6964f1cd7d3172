/** \file
 * The finished stages of a build, so that a build that was killed goes on after the last of them. */
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "map/bytes.h"

namespace raceloc {

class SqliteFile;

/** Results by the name of their stage. A result counts only for the inputs it was made from: their hash is kept with
 * it, and one made from others is as good as none. A result too large for one blob, or not wanted in memory as a whole,
 * is put in pieces ("survey 0, scans 17") before the stage's own name, which then says that it is finished.
 *
 * One SQLite file with a journal: put() is one transaction, on the disk when it returns, and a kill at any moment
 * leaves all results that were put before. One program at a time may have it open. */
class StageStore {
 public:
  enum class Open {
    anew,   ///< without the results that are there
    resume  ///< with them
  };

  /** \param path  made if it is not there
   * \throws InputError if it cannot be written, is another kind of file (which stays as it is) or is in use. */
  StageStore(const std::string& path, Open how);
  ~StageStore();
  StageStore(StageStore&&) noexcept;
  StageStore& operator=(StageStore&&) noexcept;

  /** What was put for this stage and these inputs; nothing if it was not, or is damaged: then it has to be made again.
   * \throws InputError if the file cannot be read. */
  [[nodiscard]] std::optional<Bytes> get(const std::string& stage, const std::string& input_hash) const;

  /** Keeps a result, in place of one that the stage already has.
   * \throws InputError if the disk is full; what was there stays
   * \throws std::invalid_argument if it is larger than 2^29 bytes. */
  void put(const std::string& stage, const std::string& input_hash, Bytes result);

  /** Deletes the file: the map stands. Nothing may be called after it. */
  void remove();

 private:
  std::string x_path;
  std::unique_ptr<SqliteFile> x_database;
};

/** Hash of a stage's inputs: options, names and stamps of files, hashes of the stages before it; in this order. */
[[nodiscard]] std::string inputHash(const std::vector<std::string>& inputs);

}  // namespace raceloc
