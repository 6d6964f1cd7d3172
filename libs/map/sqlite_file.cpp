#include "map/sqlite_file.h"

#include <sqlite3.h>

#include <utility>

namespace raceloc {

SqliteFile::SqliteFile(const std::string& path, std::string name, Mode mode)
    : x_name(std::move(name)), x_mode(mode) {
  const int flags = mode == Mode::read ? SQLITE_OPEN_READONLY | SQLITE_OPEN_URI
                                       : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  if (sqlite3_open_v2(path.c_str(), &x_handle, flags, nullptr) != SQLITE_OK) {
    const InputError why = error();
    sqlite3_close(x_handle);
    throw why;
  }
}

SqliteFile::~SqliteFile() { sqlite3_close(x_handle); }

void SqliteFile::run(const std::string& sql) {
  if (sqlite3_exec(x_handle, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) throw error();
}

InputError SqliteFile::error(const std::string& part) const {
  const std::string reason = " (" + std::string(sqlite3_errmsg(x_handle)) + ")";
  const int code = sqlite3_errcode(x_handle);
  if (code == SQLITE_BUSY) return InputError(x_name + ": is in use by another program" + reason);
  if (x_mode == Mode::read || code == SQLITE_CORRUPT || code == SQLITE_NOTADB)
    return damaged(part + " cannot be read" + reason);
  return InputError(x_name + ": cannot be written" + reason + "; check the space left");
}

InputError SqliteFile::damaged(const std::string& what) const {
  return InputError(x_name + ": damaged: " + what + "; copy it again or build it again");
}

SqlStatement::SqlStatement(SqliteFile& file, const std::string& sql, std::string part)
    : x_file(file), x_part(std::move(part)) {
  check(sqlite3_prepare_v2(file.handle(), sql.c_str(), -1, &x_handle, nullptr));
}

SqlStatement::~SqlStatement() { sqlite3_finalize(x_handle); }

void SqlStatement::check(int result) const {
  if (result != SQLITE_OK) throw x_file.error(x_part);
}

void SqlStatement::writeCells(const std::vector<SqlValue>& cells) {
  bind(cells);
  step();
  check(sqlite3_reset(x_handle));
}

void SqlStatement::bind(const std::vector<SqlValue>& cells) {
  struct Bind {
    sqlite3_stmt* statement;
    int index;
    int operator()(std::monostate) const { return sqlite3_bind_null(statement, index); }
    int operator()(std::int64_t value) const { return sqlite3_bind_int64(statement, index, value); }
    int operator()(double value) const { return sqlite3_bind_double(statement, index, value); }
    int operator()(const std::string& text) const {
      return sqlite3_bind_text64(statement, index, text.data(), text.size(), SQLITE_STATIC, SQLITE_UTF8);
    }
    int operator()(const Bytes& bytes) const {
      if (bytes.empty()) return sqlite3_bind_zeroblob(statement, index, 0);  // a null pointer would bind NULL
      return sqlite3_bind_blob64(statement, index, bytes.data(), bytes.size(), SQLITE_STATIC);
    }
  };
  for (std::size_t i = 0; i < cells.size(); ++i)
    check(std::visit(Bind{x_handle, static_cast<int>(i) + 1}, cells[i]));
}

bool SqlStatement::step() {
  const int result = sqlite3_step(x_handle);
  if (result != SQLITE_ROW && result != SQLITE_DONE) throw x_file.error(x_part);
  return result == SQLITE_ROW;
}

SqlValue SqlStatement::cell(int column) const {
  const auto bytes = [&] {
    const auto* data =
        static_cast<const char*>(sqlite3_column_blob(x_handle, column));  // null if it is empty
    return data == nullptr ? Bytes() : Bytes(data, data + sqlite3_column_bytes(x_handle, column));
  };
  switch (sqlite3_column_type(x_handle, column)) {
    case SQLITE_INTEGER:
      return sqlite3_column_int64(x_handle, column);
    case SQLITE_FLOAT:
      return sqlite3_column_double(x_handle, column);
    case SQLITE_TEXT: {
      const Bytes text = bytes();
      return std::string(text.begin(), text.end());
    }
    case SQLITE_BLOB:
      return bytes();
    default:
      return {};
  }
}

}  // namespace raceloc
