#include <gmock/gmock.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "core/errors.h"
#include "map/stage_store.h"
#include "support/forall.h"
#include "support/killed.h"
#include "support/run_command.h"

namespace raceloc {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

Bytes bytesOf(const std::string& text) { return {text.begin(), text.end()}; }

class StageStoreTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::string openingError(StageStore::Open how) const {
    try {
      const StageStore store(path_, how);
    } catch (const InputError& e) {
      return e.what();
    }
    return "no InputError";
  }
  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "a map.stages";
};

TEST_F(StageStoreTest, ResumesWhatWasMadeFromTheSameInputs) {
  {
    StageStore store(path_, StageStore::Open::resume);  // nothing to resume is no error
    EXPECT_FALSE(store.get("survey 0", "a").has_value());
    store.put("survey 0", "a", bytesOf("first"));
    store.put("survey 1", "b", {});
    store.put("survey 0", "a", bytesOf("second"));
  }
  {
    StageStore store(path_, StageStore::Open::resume);
    EXPECT_EQ(store.get("survey 0", "a"), bytesOf("second"));
    EXPECT_EQ(store.get("survey 1", "b"), Bytes());
    EXPECT_FALSE(store.get("survey 0", "b").has_value());
    EXPECT_FALSE(store.get("graph", "a").has_value());
    store.put("survey 0", "c", bytesOf("third"));
    EXPECT_FALSE(store.get("survey 0", "a").has_value());  // one stage, one result
  }
  {
    const StageStore anew(path_, StageStore::Open::anew);
    EXPECT_FALSE(anew.get("survey 0", "c").has_value());
  }
}

TEST_F(StageStoreTest, LeavesNothingOnceTheMapStands) {
  StageStore store(path_, StageStore::Open::anew);
  store.put("survey 0", "a", bytesOf("first"));
  store.remove();
  EXPECT_THAT(folder_.names(), IsEmpty());
}

TEST_F(StageStoreTest, ADamagedResultIsMadeAgain) {
  const std::string marked(5000, 'm');
  {
    StageStore store(path_, StageStore::Open::anew);
    store.put("survey 0", "a", bytesOf(marked));
    store.put("survey 1", "a", bytesOf("sound"));
  }
  std::string bytes;
  {
    std::ifstream in(path_, std::ios::binary);
    bytes.assign(std::istreambuf_iterator<char>(in), {});
  }
  bytes[bytes.find(marked.substr(0, 100))] = 'n';
  std::ofstream(path_, std::ios::binary) << bytes;
  const StageStore store(path_, StageStore::Open::resume);
  EXPECT_FALSE(store.get("survey 0", "a").has_value());
  EXPECT_EQ(store.get("survey 1", "a"), bytesOf("sound"));
}

TEST_F(StageStoreTest, OneBuildAtATime) {
  const StageStore store(path_, StageStore::Open::anew);
  EXPECT_THAT(openingError(StageStore::Open::resume), HasSubstr(path_ + ": is in use by another program"));
}

TEST_F(StageStoreTest, AnotherKindOfFileStaysAsItIs) {
  const std::string text(5000, 'x');
  std::ofstream(path_) << text;
  for (const auto how : {StageStore::Open::anew, StageStore::Open::resume})
    EXPECT_THAT(openingError(how), HasSubstr("build state " + path_ + ": "));
  std::ifstream in(path_);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), text);

  path_ = folder_ / "missing/a map.stages";
  EXPECT_THAT(openingError(StageStore::Open::anew), HasSubstr(path_ + ": cannot be written"));
}

TEST_F(StageStoreTest, AFullDiskLeavesTheStagesBefore) {
  StageStore store(path_, StageStore::Open::anew);
  store.put("survey 0", "a", Bytes(100'000, 'a'));
  rlimit limit{};
  getrlimit(RLIMIT_FSIZE, &limit);
  const rlimit small{200'000, limit.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_THROW(store.put("survey 1", "a", Bytes(1'000'000, 'b')), InputError);
  setrlimit(RLIMIT_FSIZE, &limit);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(store.get("survey 0", "a"), Bytes(100'000, 'a'));
  EXPECT_FALSE(store.get("survey 1", "a").has_value());
}

TEST_F(StageStoreTest, HashesTellInputsApart) {
  EXPECT_EQ(inputHash({"a", "b"}), inputHash({"a", "b"}));
  EXPECT_NE(inputHash({"a", "b"}), inputHash({"b", "a"}));
  EXPECT_NE(inputHash({"ab"}), inputHash({"a", "b"}));
}

/** A build of eight stages, each made from the one before; what a stage gives is told by its number. */
Bytes build(StageStore& store, int& made) {
  Bytes last;
  for (int stage = 0; stage < 8; ++stage) {
    const std::string name = "stage " + std::to_string(stage), hash = inputHash({name, md5Of(last)});
    auto result = store.get(name, hash);
    if (!result) {
      ++made;
      result = Bytes(200'000, static_cast<char>('a' + stage));
      store.put(name, hash, *result);
    }
    last = *result;
  }
  return last;
}

TEST_F(StageStoreTest, AKillAtAnyMomentKeepsTheFinishedStages) {
  test::Random rnd(3);
  int resumed_midway = 0;
  const int changes = test::changesOf([&] {
    StageStore store(path_, StageStore::Open::anew);
    int made = 0;
    build(store, made);
    store.remove();
  });
  for (int round = 0; round < 15; ++round) {
    test::killedAtChange(rnd.integer(1, changes), [&] {
      StageStore store(path_, StageStore::Open::anew);
      int made = 0;
      build(store, made);
    });
    StageStore store(path_, StageStore::Open::resume);
    int finished = 0, made = 0;
    Bytes last;
    for (int stage = 0; stage < 8; ++stage) {  // a finished stage has all stages before it
      const std::string name = "stage " + std::to_string(stage);
      const auto result = store.get(name, inputHash({name, md5Of(last)}));
      if (!result) break;
      ++finished;
      last = *result;
    }
    EXPECT_EQ(build(store, made), Bytes(200'000, 'h'));
    EXPECT_EQ(made, 8 - finished);
    if (finished > 0 && finished < 8) ++resumed_midway;
    store.remove();
  }
  EXPECT_GT(resumed_midway, 0);
}

}  // namespace
}  // namespace raceloc
