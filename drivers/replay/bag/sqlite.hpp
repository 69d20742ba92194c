#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include <sqlite3.h>

#include "geoflow/hal/result.hpp"

/// A thin owner of SQLite's handles. Errors carry SQLite's text; callers add which file.
namespace geoflow::drivers::bag {

class Database;

/// One prepared statement. Must not outlive its Database. Thread-bound.
class Statement {
 public:
  /// Advances to the next row: true where there is one, false at the end.
  [[nodiscard]] Result<bool> step();
  /// For a statement without result rows: runs it and makes it ready to be run again.
  [[nodiscard]] Result<void> run();
  void reset();

  /// Parameters count from 1. Bound text and bytes must stay alive until the statement is run or
  /// reset.
  Statement& bind(int parameter, std::int64_t value);
  Statement& bind(int parameter, std::string_view text);
  Statement& bind(int parameter, std::span<const std::byte> bytes);

  /// Columns count from 0; text and bytes are valid until the next step, reset or destruction.
  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] std::string_view text(int column) const;
  [[nodiscard]] std::span<const std::byte> bytes(int column) const;

 private:
  friend class Database;
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  Statement(sqlite3_stmt* statement, const Database& database);

  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
  const Database* database_;
};

/// One database connection. Thread-bound; stays where it was made, since its statements point to
/// it.
class Database {
 public:
  /// Opens an existing database without ever writing beside or into it, so that it may lie on
  /// read-only media: as immutable, or, where a write-ahead log was left behind by a writer that
  /// did not end well, together with that log. The content is not trusted: nothing in its schema is
  /// run, and the work that all statements together may cause is bounded by the size of the file.
  [[nodiscard]] static Result<std::unique_ptr<Database>> open_read_only(
      const std::filesystem::path& path);

  /// Creates a database with a write-ahead log; kInvalidArgument where the file exists.
  [[nodiscard]] static Result<std::unique_ptr<Database>> create(const std::filesystem::path& path);

  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;
  Database(Database&&) = delete;
  Database& operator=(Database&&) = delete;
  ~Database() = default;

  [[nodiscard]] Result<Statement> prepare(std::string_view sql) const;
  [[nodiscard]] Result<void> execute(std::string_view sql) const;
  [[nodiscard]] std::int64_t last_insert_id() const;
  /// `what: SQLite's text` for the call that has just failed.
  [[nodiscard]] tl::unexpected<Error> failure(std::string_view what) const;

 private:
  struct Close {
    void operator()(sqlite3* database) const { sqlite3_close_v2(database); }
  };
  Database() = default;
  [[nodiscard]] Result<void> open(const std::string& uri, int flags);
  void distrust();
  static int count_work(void* self);

  std::unique_ptr<sqlite3, Close> database_;
  std::uint64_t work_left_ = 0;
};

}  // namespace geoflow::drivers::bag
