#include "cli/app.h"

#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <system_error>
#include <utility>

#include "core/errors.h"

namespace raceloc {

int runApp(const std::string& name, const std::function<void()>& body) {
  try {
    body();
    return 0;
  } catch (const InputError& e) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), e.what());
    return 2;
  } catch (const Stopped& e) {
    std::fprintf(stderr, "%s: %s\n", name.c_str(), e.what());
    return 128 + e.signal();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: internal error, please report it: %s\n", name.c_str(), e.what());
    return 1;
  }
}

namespace {

std::atomic<int> asked_to_stop = 0;  // the signal's number
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler writes it");

}  // namespace

void stopWhenAsked() {
  struct sigaction action {};
  action.sa_handler = [](int signal) { asked_to_stop = signal; };
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
}

int stopSignal() { return asked_to_stop; }

void requireNotStopped() {
  if (asked_to_stop != 0) throw Stopped(asked_to_stop, "stopped");
}

namespace {

/** Help as a manual page would have it, and errors as InputErrors. */
class ManualOutput : public TCLAP::StdOutput {
 public:
  void usage(TCLAP::CmdLineInterface& cmd) override {
    std::cout << cmd.getMessage() << "\nOPTIONS\n";
    const std::list<TCLAP::Arg*>& args = cmd.getArgList();
    for (auto arg = args.rbegin(); arg != args.rend(); ++arg) {
      std::string text = (*arg)->getDescription();
      for (const std::string drop : {"(required)  ", "(OR required)  ", "(value required)  "})
        if (const auto at = text.find(drop); at != std::string::npos) text.erase(at, drop.size());
      std::cout << "  " << (*arg)->longID() << "\n      " << text << "\n";
    }
  }
  void version(TCLAP::CmdLineInterface& cmd) override {
    const std::string path = cmd.getProgramName();
    std::cout << path.substr(path.rfind('/') + 1) << " " << cmd.getVersion() << "\n";
  }
  void failure(TCLAP::CmdLineInterface& /*cmd*/, TCLAP::ArgException& e) override {
    throw InputError(e.error() + " " + e.argId() + " (see --help)");
  }
};

}  // namespace

CommandLine::CommandLine(const std::string& summary) : TCLAP::CmdLine(summary, ' ', RACELOC_VERSION) {
  delete _output;  // TCLAP owns its own; from here on ours lives as long as the command line
  x_output = std::make_unique<ManualOutput>();
  setOutput(x_output.get());
}

CommandLine::~CommandLine() = default;

bool CommandLine::parse(std::vector<std::string> words) {
  std::vector<char*> argv;
  argv.reserve(words.size());
  for (auto& word : words) argv.push_back(word.data());
  return parse(static_cast<int>(argv.size()), argv.data());
}

Progress::Progress(std::string what)
    : x_what(std::move(what)),
      x_start(std::chrono::steady_clock::now()),
      x_drawn(x_start),
      x_visible(isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() {
  if (x_visible) std::fprintf(stderr, "\r\033[K");
}

void Progress::operator()(double share) {
  const auto now = std::chrono::steady_clock::now();
  if (!x_visible || now - x_drawn < std::chrono::milliseconds(200)) return;
  x_drawn = now;
  const double spent_s = std::chrono::duration<double>(now - x_start).count();
  const double left_s = share > 0 ? spent_s * (1 - share) / share : 0;
  constexpr int kWidth = 30;
  const int done = static_cast<int>(share * kWidth);
  std::string bar(kWidth, '.');
  bar.replace(0, static_cast<std::size_t>(done), static_cast<std::size_t>(done), '#');
  std::fprintf(stderr, "\r\033[K%s [%s] %3.0f %%, %.0f s left", x_what.c_str(), bar.c_str(), 100 * share,
               left_s);
  std::fflush(stderr);
}

namespace {

/** One file under two names, whether it is there or not. */
bool isSame(const std::string& a, const std::string& b) {
  std::error_code unknown;
  return !a.empty() && !b.empty() &&
         std::filesystem::weakly_canonical(a, unknown) == std::filesystem::weakly_canonical(b, unknown);
}

}  // namespace

void requireApart(const std::vector<std::string>& inputs, const std::vector<std::string>& outputs) {
  for (auto output = outputs.begin(); output != outputs.end(); ++output) {
    for (const std::string& input : inputs)
      if (isSame(input, *output))
        throw InputError("output " + *output + ": is an input too; give it another name");
    for (auto other = outputs.begin(); other != output; ++other)
      if (isSame(*other, *output)) throw InputError("output " + *output + ": is to be written twice");
  }
}

std::string toolVersion() { return RACELOC_VERSION; }

double cpuTime_s() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double peakMemory_MiB() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace raceloc
