/** \file
 * A kill at the worst moment leaves the files that were there, and does not stand in the way of the next run.
 */
#include <gmock/gmock.h>
#include <poll.h>
#include <sys/inotify.h>
#include <sys/syscall.h>

#include "apps/apps.h"

namespace {

using namespace raceloc::test;
using ::testing::HasSubstr;

const DriveFiles kDrive("synthetic");
const std::string kOld = "what was here before\n";

/** Waits until something in `folder` is created or written, whichever `event` says; false when `program` ends
 * first. */
class FolderWatch {
 public:
  FolderWatch(const std::string& folder, std::uint32_t event) : x_watch(inotify_init1(IN_CLOEXEC)) {
    if (x_watch < 0 || inotify_add_watch(x_watch, folder.c_str(), event) < 0)
      throw std::runtime_error("cannot watch " + folder);
  }
  FolderWatch(const FolderWatch&) = delete;
  FolderWatch& operator=(const FolderWatch&) = delete;
  ~FolderWatch() { close(x_watch); }
  [[nodiscard]] bool sawEvent(const RunningCommand& program) const {
    const int process = static_cast<int>(syscall(SYS_pidfd_open, program.pid(), 0));
    if (process < 0) throw std::runtime_error("cannot watch the program");
    std::array<pollfd, 2> either{pollfd{x_watch, POLLIN, 0}, pollfd{process, POLLIN, 0}};
    constexpr int kLimit_ms = 300'000;
    const int ready = poll(either.data(), either.size(), kLimit_ms);
    close(process);
    return ready > 0 && (either[0].revents & POLLIN) != 0;
  }

 private:
  int x_watch;
};

class Killed : public ::testing::TestWithParam<std::uint32_t> {};
INSTANTIATE_TEST_SUITE_P(When, Killed, ::testing::Values(IN_CREATE, IN_MODIFY), [](const auto& test) {
  return test.param == IN_CREATE ? "its_first_file_appears" : "it_writes";
});

TEST_P(Killed, MapLeavesTheOldMap) {
  const TemporaryFolder out;
  writeFile(out / "map.rlmap", kOld);
  const auto command = mapCommand(ini("map.ini"), kDrive.survey(), out);
  {
    const FolderWatch watch(out / "", GetParam());
    RunningCommand map(command);
    ASSERT_TRUE(watch.sawEvent(map));
    map.kill();
    EXPECT_EQ(map.wait().exit_code, 128 + SIGKILL);
  }
  EXPECT_EQ(readFile(out / "map.rlmap"), kOld);

  const auto again = runCommand(command);
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_TRUE(readFile(out / "map.rlmap") == readFile(kDrive.map()));  // same log, same bits
  for (const auto& name : out.names()) EXPECT_THAT(name, Not(HasSubstr(".part")));
}

TEST_P(Killed, LiveLeavesTheOldLogAndTrajectory) {
  const TemporaryFolder out;
  writeFile(out / "out.rawlog", kOld);
  writeFile(out / "race.tum", kOld);
  const auto command = liveCommand(ini("live.ini"), kDrive.map(), kDrive.race(), out);
  {
    const FolderWatch watch(out / "", GetParam());
    RunningCommand live(command);
    ASSERT_TRUE(watch.sawEvent(live));
    live.kill();
    EXPECT_EQ(live.wait().exit_code, 128 + SIGKILL);
  }
  EXPECT_EQ(readFile(out / "out.rawlog"), kOld);
  EXPECT_EQ(readFile(out / "race.tum"), kOld);

  const auto again = runCommand(command);
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(out.names(), ::testing::UnorderedElementsAre("out.rawlog", "race.tum"));
}

}  // namespace
