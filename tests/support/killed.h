/** \file
 * Work that dies at any moment: at its n-th change of a file, whatever the clock says. */
#pragma once

#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>

namespace raceloc::test {

/** SQLite's calls that change files: counted, and the last one of a life not made. */
class FileChanges {
 public:
  /** From now on in this process. \param last  the process kills itself in place of this change; 0: never */
  static void count(int last) {
    made = 0;
    until = last;
    sqlite3_initialize();
    replace("write", x_write, &write);
    replace("pwrite", x_pwrite, &pwrite);
    replace("pwrite64", x_pwrite64, &pwrite64);
    replace("ftruncate", x_truncate, &truncate);
    replace("unlink", x_unlink, &unlink);
  }
  static inline int made = 0;

 private:
  using Write = ssize_t (*)(int, const void*, size_t);
  using WriteAt = ssize_t (*)(int, const void*, size_t, off_t);
  using Truncate = int (*)(int, off_t);
  using Unlink = int (*)(const char*);

  template <class Call>
  static void replace(const char* name, Call& original, Call counting) {
    sqlite3_vfs* vfs = sqlite3_vfs_find(nullptr);
    if (original != nullptr) return;  // done before
    original = reinterpret_cast<Call>(vfs->xGetSystemCall(vfs, name));
    if (original != nullptr)  // a build of SQLite has one of the two pwrites
      vfs->xSetSystemCall(vfs, name, reinterpret_cast<sqlite3_syscall_ptr>(counting));
  }
  static void change() {
    if (++made == until) raise(SIGKILL);
  }
  static ssize_t write(int file, const void* data, size_t size) {
    return change(), x_write(file, data, size);
  }
  static ssize_t pwrite(int file, const void* data, size_t size, off_t at) {
    return change(), x_pwrite(file, data, size, at);
  }
  static ssize_t pwrite64(int file, const void* data, size_t size, off_t at) {
    return change(), x_pwrite64(file, data, size, at);
  }
  static int truncate(int file, off_t size) { return change(), x_truncate(file, size); }
  static int unlink(const char* path) { return change(), x_unlink(path); }

  static inline int until = 0;
  static inline Write x_write = nullptr;
  static inline WriteAt x_pwrite = nullptr, x_pwrite64 = nullptr;
  static inline Truncate x_truncate = nullptr;
  static inline Unlink x_unlink = nullptr;
};

/** How many changes `work` makes. */
template <class Work>
int changesOf(const Work& work) {
  FileChanges::count(0);
  work();
  return FileChanges::made;
}

/** Runs `work` in a process of its own, which dies in place of its change number `last`, if it gets there. */
template <class Work>
void killedAtChange(int last, const Work& work) {
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("cannot fork");
  if (child == 0) {
    FileChanges::count(last);
    work();
    _exit(0);
  }
  waitpid(child, nullptr, 0);
}

}  // namespace raceloc::test
