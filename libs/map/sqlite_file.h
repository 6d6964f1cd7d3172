/** \file
 * SQLite for the files of this folder: every failure becomes an InputError, because what can fail in fixed statements
 * is the file. */
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "core/errors.h"
#include "map/bytes.h"

struct sqlite3;
struct sqlite3_stmt;

namespace raceloc {

/** One connection. */
class SqliteFile {
 public:
  enum class Mode { read, write };

  /** `path` is what SQLite opens (in mode read: a URI), `name` what errors call it. \throws InputError */
  SqliteFile(const std::string& path, std::string name, Mode mode);
  ~SqliteFile();
  SqliteFile(const SqliteFile&) = delete;
  SqliteFile& operator=(const SqliteFile&) = delete;

  void run(const std::string& sql);  ///< \throws InputError

  /** The newest failure, for the user. `part` is the part of the file it happened in. */
  [[nodiscard]] InputError error(const std::string& part = "it") const;
  [[nodiscard]] InputError damaged(const std::string& what) const;

  [[nodiscard]] sqlite3* handle() const { return x_handle; }

 private:
  sqlite3* x_handle = nullptr;
  std::string x_name;
  Mode x_mode;
};

/** What one column of one row holds. */
using SqlValue = std::variant<std::monostate, std::int64_t, double, std::string, Bytes>;

/** A prepared statement; `part` is what its failures are about. */
class SqlStatement {
 public:
  SqlStatement(SqliteFile& file, const std::string& sql, std::string part);
  ~SqlStatement();
  SqlStatement(const SqlStatement&) = delete;
  SqlStatement& operator=(const SqlStatement&) = delete;

  /** Binds all parameters in order and runs a statement that returns no row. */
  template <class... Values>
  void write(Values&&... values) {
    std::vector<SqlValue> cells;
    cells.reserve(sizeof...(values));
    (cells.emplace_back(std::forward<Values>(values)), ...);
    writeCells(cells);
  }
  void writeCells(const std::vector<SqlValue>& cells);
  /** The cells must outlive the steps. */
  void bind(const std::vector<SqlValue>& cells);
  bool step();  ///< whether there is a row
  [[nodiscard]] SqlValue cell(int column) const;
  /** \throws InputError if the column holds something else. */
  template <class T>
  [[nodiscard]] T get(int column) const {
    SqlValue found = cell(column);
    if (auto* value = std::get_if<T>(&found)) return std::move(*value);
    throw x_file.damaged(x_part + " has a column of the wrong type");
  }

 private:
  void check(int result) const;

  SqliteFile& x_file;
  std::string x_part;
  sqlite3_stmt* x_handle = nullptr;
};

}  // namespace raceloc
