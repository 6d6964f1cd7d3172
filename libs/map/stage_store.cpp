#include "map/stage_store.h"

#include <zlib.h>

#include <filesystem>
#include <stdexcept>
#include <utility>

#include "core/errors.h"
#include "map/sqlite_file.h"

namespace raceloc {

namespace {

constexpr std::int64_t kStoreId = 0x524C5354;  // "RLST"
constexpr std::int64_t kStoreVersion = 2;
constexpr std::size_t kLargest = std::size_t{1} << 29U;  // SQLite takes a little less than twice that

std::int64_t numberOf(SqliteFile& file, const std::string& sql) {
  SqlStatement statement(file, sql, "header");
  return statement.step() ? statement.get<std::int64_t>(0) : 0;
}

/** Of the whole row: a result under another name is found as well. */
std::string checksumOf(const std::string& stage, const std::string& input_hash, const Bytes& result) {
  const auto crc = crc32_z(0, reinterpret_cast<const Bytef*>(result.data()), result.size());
  return inputHash({stage, input_hash, std::to_string(crc)});
}

}  // namespace

StageStore::StageStore(const std::string& path, Open how)
    : x_path(path),
      x_database(std::make_unique<SqliteFile>(path, "build state " + path, SqliteFile::Mode::write)) {
  SqliteFile& file = *x_database;
  file.run("PRAGMA locking_mode=EXCLUSIVE; PRAGMA synchronous=FULL; BEGIN EXCLUSIVE");
  const std::int64_t id = numberOf(file, "PRAGMA application_id");
  const bool is_new = id == 0 && numberOf(file, "SELECT COUNT(*) FROM sqlite_master") == 0;
  if (!is_new && id != kStoreId)
    throw InputError("build state " + path +
                     ": is another kind of file; give the map another name or move it away");
  if (how == Open::anew || is_new || numberOf(file, "PRAGMA user_version") != kStoreVersion)
    file.run(
        "DROP TABLE IF EXISTS stages;"
        "CREATE TABLE stages(stage TEXT PRIMARY KEY, input_hash TEXT NOT NULL, checksum TEXT NOT NULL,"
        " result BLOB NOT NULL);"
        "PRAGMA application_id=" +
        std::to_string(kStoreId) + "; PRAGMA user_version=" + std::to_string(kStoreVersion));
  file.run("COMMIT");
}

StageStore::~StageStore() = default;
StageStore::StageStore(StageStore&&) noexcept = default;
StageStore& StageStore::operator=(StageStore&&) noexcept = default;

std::optional<Bytes> StageStore::get(const std::string& stage, const std::string& input_hash) const {
  SqlStatement select(*x_database, "SELECT checksum, result FROM stages WHERE stage = ? AND input_hash = ?",
                      "stage " + stage);
  const std::vector<SqlValue> wanted{stage, input_hash};
  select.bind(wanted);
  if (!select.step()) return std::nullopt;
  Bytes result = select.get<Bytes>(1);
  if (select.get<std::string>(0) != checksumOf(stage, input_hash, result)) return std::nullopt;
  return result;
}

void StageStore::put(const std::string& stage, const std::string& input_hash, Bytes result) {
  if (result.size() > kLargest) throw std::invalid_argument("StageStore: put stage " + stage + " in pieces");
  std::string checksum = checksumOf(stage, input_hash, result);
  SqlStatement(*x_database, "INSERT OR REPLACE INTO stages VALUES(?, ?, ?, ?)", "stage " + stage)
      .write(stage, input_hash, std::move(checksum), std::move(result));
}

void StageStore::remove() {
  x_database.reset();
  std::error_code ignored;  // a file that stays costs space alone: the next build starts anew
  std::filesystem::remove(x_path, ignored);
  std::filesystem::remove(x_path + "-journal", ignored);
}

std::string inputHash(const std::vector<std::string>& inputs) {
  Bytes bytes;
  for (const std::string& input : inputs) append(bytes, input);
  return md5Of(bytes);
}

}  // namespace raceloc
