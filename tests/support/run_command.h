/** \file
 * Programs under test, run as a shell would run them. */
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace raceloc::test {

struct CommandResult {
  int exit_code;  ///< 128 + N after signal N, as in a shell; 137 also when the time was up
  std::string out, err;
};

/** A program that runs, with no standard input. The destructor kills it. */
class RunningCommand {
 public:
  explicit RunningCommand(std::vector<std::string> words) : x_out(std::tmpfile()), x_err(std::tmpfile()) {
    if (x_out == nullptr || x_err == nullptr) throw std::runtime_error("no temporary file");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, fileno(x_out), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, fileno(x_err), STDERR_FILENO);
    std::vector<char*> argv;
    argv.reserve(words.size() + 1);
    for (auto& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const int error = posix_spawnp(&x_pid, argv[0], &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) throw std::runtime_error("cannot run " + words[0]);
  }
  RunningCommand(const RunningCommand&) = delete;
  RunningCommand& operator=(const RunningCommand&) = delete;
  ~RunningCommand() {
    if (x_pid > 0) {
      kill();
      (void)wait();
    }
    std::fclose(x_out);
    std::fclose(x_err);
  }

  [[nodiscard]] pid_t pid() const { return x_pid; }
  /** What it has said on stderr by now. */
  [[nodiscard]] std::string errSoFar() const {
    std::string text;
    std::array<char, 4096> block{};
    const auto read = [&] {  // pread: the program writes at the position that both share
      return pread(fileno(x_err), block.data(), block.size(), static_cast<off_t>(text.size()));
    };
    for (auto n = read(); n > 0; n = read()) text.append(block.data(), static_cast<std::size_t>(n));
    return text;
  }
  void kill(int signal = SIGKILL) const { ::kill(x_pid, signal); }
  CommandResult wait() {
    int status = 0;
    waitpid(x_pid, &status, 0);
    x_pid = 0;
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), textOf(x_out), textOf(x_err)};
  }

 private:
  static std::string textOf(std::FILE* file) {
    std::string text;
    std::array<char, 4096> block{};
    std::rewind(file);
    while (const auto n = std::fread(block.data(), 1, block.size(), file)) text.append(block.data(), n);
    return text;
  }
  pid_t x_pid = 0;
  std::FILE *x_out, *x_err;
};

/** Runs a program to its end, for at most `limit_s`. */
inline CommandResult runCommand(std::vector<std::string> words, int limit_s = 300) {
  words.insert(words.begin(), {"timeout", "-s", "KILL", std::to_string(limit_s)});
  return RunningCommand(std::move(words)).wait();
}

/** A folder of its own for one test, gone afterwards. */
class TemporaryFolder {
 public:
  TemporaryFolder() : x_path(std::filesystem::temp_directory_path() / "raceloc_test_XXXXXX") {
    std::string name = x_path.string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make " + name);
    x_path = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(x_path, ignored);
  }
  [[nodiscard]] std::string operator/(const std::string& name) const { return (x_path / name).string(); }
  /** Names in it, hidden ones and temporary ones included. */
  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(x_path))
      names.push_back(entry.path().filename());
    return names;
  }

 private:
  std::filesystem::path x_path;
};

}  // namespace raceloc::test
