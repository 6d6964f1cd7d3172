/** \file
 * Files appear under their name only when they are whole. */
#pragma once

#include <string>

#include "core/errors.h"

namespace raceloc {

/** "output P: cannot be written; check the folder, its rights and the space left", with the system's reason if it is
 * known. */
[[nodiscard]] InputError cannotWrite(const std::string& path, const std::string& reason = "");

/** Claims a temporary name beside the final one; commit() renames it, and a destructor without commit()
 * removes it. A kill at any moment leaves what was there before. */
class OutputFile {
 public:
  /** \throws InputError at once if the folder does not exist or cannot be written, so that no work is lost.
   */
  explicit OutputFile(std::string path);
  ~OutputFile();
  OutputFile(OutputFile&&) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;

  [[nodiscard]] const std::string& temporaryPath() const { return x_temporary; }  ///< write here
  [[nodiscard]] const std::string& path() const { return x_path; }
  /** Flushes to the disk and renames. \throws InputError if the file system refuses (full, read-only). */
  void commit();

 private:
  std::string x_path, x_temporary;
};

/** Writes a small text file whole. \throws InputError as OutputFile does. */
void writeTextFile(const std::string& path, const std::string& text);

}  // namespace raceloc
