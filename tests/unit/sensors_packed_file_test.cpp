#include <gmock/gmock.h>
#include <zlib.h>

#include <random>
#include <string>

#include "sensors/packed_file.h"
#include "support/files.h"
#include "support/run_command.h"

namespace raceloc {
namespace {

using namespace test;

/** Some of it packs well, some not at all; longer than the reader's buffers. */
std::string someBytes() {
  std::mt19937 engine(1);
  std::string bytes;
  for (int i = 0; i < 300'000; ++i) bytes.push_back(static_cast<char>(engine() >> 24U));
  for (int i = 0; i < 900'000; ++i) bytes.push_back(static_cast<char>(i / 1000));
  return bytes;
}

std::string gzipped(const std::string& path, const std::string& bytes, const char* mode) {
  gzFile file = gzopen(path.c_str(), mode);
  gzwrite(file, bytes.data(), static_cast<unsigned>(bytes.size()));
  gzclose(file);
  return path;
}

/** In pieces of any length, as an archive asks for them. */
std::string readAll(PackedFile& file) {
  std::mt19937 engine(2);
  std::string bytes;
  for (;;) {
    std::string piece(std::size_t{1} << (engine() % 20), '\0');
    const std::size_t got = file.Read(piece.data(), piece.size());
    bytes.append(piece, 0, got);
    if (got < piece.size()) return bytes;
  }
}

class PackedFileTest : public ::testing::Test {
 protected:
  const TemporaryFolder out;
};

TEST_F(PackedFileTest, GivesWhatWasPackedAtAnyLevelAndPlainBytesAsTheyAre) {
  const std::string bytes = someBytes();
  for (const char* mode : {"wb1", "wb6", "wb9", "wb0"}) {
    PackedFile file(gzipped(out / "a.gz", bytes, mode));
    ASSERT_TRUE(file.good());
    EXPECT_TRUE(readAll(file) == bytes) << mode;
    EXPECT_FALSE(file.isCut());
    EXPECT_EQ(file.getPosition(), file.getTotalBytesCount());
  }
  writeFile(out / "plain", bytes);
  PackedFile plain(out / "plain");
  EXPECT_TRUE(readAll(plain) == bytes);
  EXPECT_FALSE(plain.isCut());
}

TEST_F(PackedFileTest, ReadsOneMemberAfterTheOther) {
  const std::string bytes = someBytes();
  gzipped(out / "a.gz", bytes, "wb1");
  gzipped(out / "a.gz", "and more", "ab1");
  PackedFile file(out / "a.gz");
  EXPECT_TRUE(readAll(file) == bytes + "and more");
  EXPECT_FALSE(file.isCut());
}

TEST_F(PackedFileTest, TellsAFileThatIsCutWhereverItIs) {
  const std::string packed = readFile(gzipped(out / "a.gz", someBytes(), "wb1"));
  for (const std::size_t left : {std::size_t{2}, std::size_t{9}, packed.size() / 2, packed.size() - 1}) {
    writeFile(out / "cut.gz", packed.substr(0, left));
    PackedFile file(out / "cut.gz");
    readAll(file);
    EXPECT_TRUE(file.isCut()) << left;
  }
}

TEST_F(PackedFileTest, ThrowsWhereABitIsWrong) {
  std::string packed = readFile(gzipped(out / "a.gz", someBytes(), "wb1"));
  packed[packed.size() / 8] = static_cast<char>(packed[packed.size() / 8] ^ 16);
  writeFile(out / "bad.gz", packed);
  PackedFile file(out / "bad.gz");
  EXPECT_THROW(readAll(file), std::runtime_error);
}

TEST_F(PackedFileTest, IsNotGoodWhereThereIsNoFile) {
  EXPECT_FALSE(PackedFile(out / "nowhere").good());
  EXPECT_FALSE(PackedFile(out / "").good());
  writeFile(out / "empty", "");
  PackedFile empty(out / "empty");
  EXPECT_TRUE(empty.good());
  EXPECT_EQ(readAll(empty), "");
}

}  // namespace
}  // namespace raceloc
