/** \file
 * Work that dies at any moment. */
#pragma once

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <stdexcept>
#include <thread>

namespace raceloc::test {

template <class Work>
double secondsOf(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/** Runs `work` in a process of its own and kills that after `time_s`, unless it ends before. */
template <class Work>
void killedAfter(double time_s, const Work& work) {
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("cannot fork");
  if (child == 0) {
    work();
    _exit(0);
  }
  std::this_thread::sleep_for(std::chrono::duration<double>(time_s));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
}

}  // namespace raceloc::test
