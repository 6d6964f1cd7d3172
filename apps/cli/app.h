/** \file
 * What every app shares: one way to end, one way to show progress. */
#pragma once

#include <mrpt/3rdparty/tclap/CmdLine.h>

#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace raceloc {

/** Runs `body` and turns how it ends into what the user sees: 0 when it returns; one line on stderr and 2 for
 * an InputError (bad arguments are one); one line and 128 + the signal's number when it was Stopped; the line of the
 * exception and 1 for anything else. */
int runApp(const std::string& name, const std::function<void()>& body);

/** The user wants no more of it. */
class Stopped : public std::runtime_error {
 public:
  Stopped(int signal, const std::string& words) : std::runtime_error(words), x_signal(signal) {}
  [[nodiscard]] int signal() const { return x_signal; }

 private:
  int x_signal;
};
/** From now on the first SIGINT or SIGTERM is a wish; the next one ends the process, as ever. */
void stopWhenAsked();
/** The signal's number after one, else 0. */
[[nodiscard]] int stopSignal();
/** \throws Stopped after such a signal */
void requireNotStopped();

/** A command line in MRPT's manner. `summary` is what `--help` prints first, line by line as given: NAME,
 * what it does, EXAMPLES, EXIT STATUS. parse() returns false after `--help` or `--version`: the app then just
 * returns. \throws InputError (from parse) for arguments that do not fit. */
class CommandLine : public TCLAP::CmdLine {
 public:
  explicit CommandLine(const std::string& summary);
  ~CommandLine() override;
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;
  using TCLAP::CmdLine::parse;
  bool parse(std::vector<std::string> words);  ///< the program's name, then its arguments

 private:
  std::unique_ptr<TCLAP::CmdLineOutput> x_output;
};

/** A line on stderr that is drawn again at most five times a second, with the time left; silent when stderr
 * is no terminal. */
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void operator()(double share);  ///< 0..1

 private:
  std::string x_what;
  std::chrono::steady_clock::time_point x_start, x_drawn;
  bool x_visible;
};

/** Runs `look(progress)` with a line of progress. \throws Stopped when somebody wants no more of it. */
template <class Look>
auto lookedThrough(const Look& look) {
  Progress line("looking through");
  return look([&](double share) {
    requireNotStopped();
    line(share);
  });
}

/** Empty names are files that nobody asked for. \throws InputError for an output that is an input, or another output. */
void requireApart(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs);

[[nodiscard]] std::string toolVersion();  ///< "0.1.0"

/** Time that all threads of this process have spent computing [s]. */
[[nodiscard]] double cpuTime_s();
/** Peak resident memory of this process [MiB], as the operating system counts it. */
[[nodiscard]] double peakMemory_MiB();

}  // namespace raceloc
