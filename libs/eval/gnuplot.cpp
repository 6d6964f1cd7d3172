#include "eval/gnuplot.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "core/errors.h"

namespace raceloc {

namespace {

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

/** Without a name, gone when closed: nothing to clean up after a kill. */
File nameless() {
  File file(std::tmpfile());
  if (!file)
    throw InputError(std::string("temporary file: cannot be made (") + std::strerror(errno) +
                     "); check /tmp");
  return file;
}

std::string contents(std::FILE* file) {
  std::string text;
  char block[65536];
  std::rewind(file);
  for (std::size_t n = 0; (n = std::fread(block, 1, sizeof block, file)) > 0;) text.append(block, n);
  return text;
}

}  // namespace

std::string gnuplot(const std::string& script) {
  const File in = nameless();
  const File out = nameless();
  const File complaints = nameless();
  if (std::fwrite(script.data(), 1, script.size(), in.get()) != script.size() || std::fflush(in.get()) != 0)
    throw InputError(std::string("temporary file: cannot be written (") + std::strerror(errno) +
                     "); check /tmp");
  std::rewind(in.get());

  posix_spawn_file_actions_t streams;
  posix_spawn_file_actions_init(&streams);
  posix_spawn_file_actions_adddup2(&streams, fileno(in.get()), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&streams, fileno(out.get()), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&streams, fileno(complaints.get()), STDERR_FILENO);
  std::string name = "gnuplot";
  std::string no_user_settings = "-d";
  char* arguments[] = {name.data(), no_user_settings.data(), nullptr};
  pid_t child = 0;
  const int failed = posix_spawnp(&child, name.c_str(), &streams, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&streams);
  if (failed == ENOENT)
    throw InputError("gnuplot: not found, and it draws the pictures; install gnuplot-nox");
  if (failed != 0)
    throw InputError(std::string("gnuplot: cannot be started (") + std::strerror(failed) + ")");

  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) throw std::runtime_error(std::string("waitpid: ") + std::strerror(errno));
  std::string picture = contents(out.get());
  if (status != 0 || picture.empty())
    throw std::runtime_error("gnuplot failed: " + contents(complaints.get()));
  return picture;
}

}  // namespace raceloc
