#include "cli/process_usage.h"

#include <dirent.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/errors.h"

namespace raceloc {

namespace {

using Clock = std::chrono::steady_clock;
constexpr double kMiB = 1024.0 * 1024.0;

double secondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double seconds(const timeval& t) {
  return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
}

/** What /proc/PID/stat says of one process. */
struct ProcessStat {
  pid_t parent = 0;
  double cpu_s = 0;           ///< own, to 10 ms
  double children_cpu_s = 0;  ///< of those that it has waited for
  double rss_MiB = 0;
};

/** Nothing for a process that is gone. */
bool readStat(pid_t pid, ProcessStat& stat) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string text;
  if (!std::getline(file, text)) return false;
  const auto name_end = text.rfind(')');  // the name may hold anything
  if (name_end == std::string::npos) return false;
  std::istringstream fields(text.substr(name_end + 1));
  char state = 0;
  double skipped = 0, ticks[4], pages = 0;
  fields >> state >> stat.parent;
  for (int i = 5; i <= 13; ++i) fields >> skipped;
  for (double& t : ticks) fields >> t;  // utime stime cutime cstime
  for (int i = 18; i <= 23; ++i) fields >> skipped;
  fields >> pages;
  if (!fields) return false;
  static const double tick_s = 1.0 / static_cast<double>(sysconf(_SC_CLK_TCK));
  static const double page_MiB = static_cast<double>(sysconf(_SC_PAGESIZE)) / kMiB;
  stat.cpu_s = (ticks[0] + ticks[1]) * tick_s;
  stat.children_cpu_s = (ticks[2] + ticks[3]) * tick_s;
  stat.rss_MiB = pages * page_MiB;
  return true;
}

/** CPU time of a live process, finer than /proc tells it. */
double cpuTime_s(pid_t pid, double coarse_s) {
  clockid_t clock{};
  timespec time{};
  if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &time) != 0) return coarse_s;
  return std::max(coarse_s, static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec));
}

std::map<pid_t, ProcessStat> allProcesses() {
  std::map<pid_t, ProcessStat> processes;
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(opendir("/proc"), closedir);
  if (!folder) return processes;
  while (const dirent* entry = readdir(folder.get())) {
    char* end = nullptr;
    const long pid = std::strtol(entry->d_name, &end, 10);
    ProcessStat stat;
    if (pid > 0 && *end == '\0' && readStat(static_cast<pid_t>(pid), stat))
      processes[static_cast<pid_t>(pid)] = stat;
  }
  return processes;
}

/** The command and what it started. Orphans are children of this process, which is their subreaper. */
TreeReading treeUsage() {
  const auto processes = allProcesses();
  const pid_t self = getpid();
  const auto isOurs = [&](pid_t pid) {
    for (int depth = 0; depth < 100; ++depth) {
      const auto process = processes.find(pid);
      if (process == processes.end()) return false;
      pid = process->second.parent;
      if (pid == self) return true;
    }
    return false;
  };
  TreeReading sum;
  for (const auto& [pid, stat] : processes) {
    if (!isOurs(pid)) continue;
    sum.cpu_s += cpuTime_s(pid, stat.cpu_s) + stat.children_cpu_s;
    sum.rss_MiB += stat.rss_MiB;
  }
  return sum;
}

/** SIGCHLD, SIGINT and SIGTERM are waited for while this lives, instead of interrupting. */
class WaitedSignals {
 public:
  WaitedSignals() {
    sigemptyset(&x_set);
    for (const int signal : {SIGCHLD, SIGINT, SIGTERM}) sigaddset(&x_set, signal);
    sigprocmask(SIG_BLOCK, &x_set, &x_before);
  }
  ~WaitedSignals() { sigprocmask(SIG_SETMASK, &x_before, nullptr); }
  WaitedSignals(const WaitedSignals&) = delete;
  WaitedSignals& operator=(const WaitedSignals&) = delete;
  /** Until one comes, or the time is over. */
  void wait(double limit_s, pid_t child) const {
    const double whole_s = std::floor(std::max(limit_s, 0.0));
    const timespec limit{static_cast<time_t>(whole_s),
                         static_cast<long>(1e9 * (std::max(limit_s, 0.0) - whole_s))};
    siginfo_t info{};
    const int signal = sigtimedwait(&x_set, &info, &limit);
    if ((signal == SIGINT || signal == SIGTERM) && info.si_code == SI_USER) kill(child, signal);
  }
  [[nodiscard]] const sigset_t& before() const { return x_before; }

 private:
  sigset_t x_set{}, x_before{};
};

pid_t start(const std::vector<std::string>& command, const sigset_t& mask) {
  std::vector<std::string> words = command;
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setsigmask(&attributes, &mask);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  pid_t child = 0;
  const int failed = posix_spawnp(&child, argv[0], nullptr, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  if (failed != 0)
    throw InputError("command " + command.front() + ": cannot be started (" + std::strerror(failed) +
                     "); check its name and its rights");
  return child;
}

}  // namespace

ProcessUsage runMeasured(const std::vector<std::string>& command, double period_s) {
  prctl(PR_SET_CHILD_SUBREAPER, 1);
  const WaitedSignals signals;
  const auto begin = Clock::now();
  const pid_t child = start(command, signals.before());
  UsageLog log;
  double next_s = period_s;
  int status = 0;
  rusage usage{};
  for (;;) {
    const pid_t ended = wait4(child, &status, WNOHANG, &usage);
    if (ended < 0 && errno != EINTR) throw std::runtime_error(std::string("wait4: ") + std::strerror(errno));
    if (ended == child) break;
    const double now_s = secondsSince(begin);
    if (now_s >= next_s) {
      log.add(now_s, treeUsage());
      next_s = std::max(next_s + period_s, now_s);
    }
    signals.wait(next_s - secondsSince(begin), child);
  }
  ProcessUsage result{};
  result.wall_s = secondsSince(begin);
  result.exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.user_s = seconds(usage.ru_utime);
  result.system_s = seconds(usage.ru_stime);
  result.cores_mean = result.cpu_s() / std::max(result.wall_s, 1e-9);
  result.peak_rss_MiB = static_cast<double>(usage.ru_maxrss) / 1024;
  log.fill(result);
  return result;
}

}  // namespace raceloc
