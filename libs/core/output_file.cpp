#include "core/output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>

namespace raceloc {

namespace {

/** ".part" goes before the extension: writers that look at the extension still see it. */
std::string temporaryName(const std::string& path) {
  const std::filesystem::path p(path);
  return (p.parent_path() / (p.stem().string() + ".part" + p.extension().string())).string();
}

}  // namespace

InputError cannotWrite(const std::string& path, const std::string& reason) {
  return InputError("output " + path + ": cannot be written" + (reason.empty() ? "" : " (" + reason + ")") +
                    "; check the folder, its rights and the space left");
}

OutputFile::OutputFile(std::string path) : x_path(std::move(path)), x_temporary(temporaryName(x_path)) {
  if (std::filesystem::is_directory(x_path)) throw cannotWrite(x_path, std::strerror(EISDIR));
  const int fd = ::open(x_temporary.c_str(), O_CREAT | O_WRONLY | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) throw cannotWrite(x_path, std::strerror(errno));
  ::close(fd);
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : x_path(std::move(other.x_path)), x_temporary(std::exchange(other.x_temporary, {})) {}

OutputFile::~OutputFile() {
  std::error_code ignored;
  if (!x_temporary.empty()) std::filesystem::remove(x_temporary, ignored);
}

void OutputFile::commit() {
  const int fd = ::open(x_temporary.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) throw cannotWrite(x_path, std::strerror(errno));
  const int synced = ::fsync(fd);
  const int sync_error = errno;
  ::close(fd);
  if (synced != 0) throw cannotWrite(x_path, std::strerror(sync_error));
  if (std::rename(x_temporary.c_str(), x_path.c_str()) != 0) throw cannotWrite(x_path, std::strerror(errno));
  x_temporary.clear();
}

void writeTextFile(const std::string& path, const std::string& text) {
  OutputFile file(path);
  std::ofstream out(file.temporaryPath(), std::ios::binary);
  out << text;
  out.close();
  if (!out) throw cannotWrite(path, std::strerror(errno));
  file.commit();
}

}  // namespace raceloc
