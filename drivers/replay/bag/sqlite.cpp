#include "replay/bag/sqlite.hpp"

#include <cctype>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <sqlite3.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::bag {
namespace {

// The largest value that is read from a file: a raw image of 4096 x 4096 RGB pixels with room to
// spare.
constexpr int kMaxValueBytes = 64 * 1024 * 1024;

// Work is counted in SQLite's virtual machine instructions. Reading a bag takes about 20 a message
// and every message fills more than 8 bytes of the file, so an honest file stays an order of
// magnitude below this.
constexpr std::uint64_t kWorkFloor = 1'000'000;
constexpr std::uint64_t kWorkPerFileByte = 64;
constexpr int kWorkQuantum = 10'000;

std::string percent_encoded(const std::filesystem::path& path) {
  std::string text;
  for (const char c : path.native()) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) != 0 || c == '/' || c == '.' || c == '-' || c == '_') {
      text += c;
    } else {
      text += fmt::format("%{:02X}", byte);
    }
  }
  return text;
}

bool has_content(const std::filesystem::path& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  return !error && size > 0;
}

std::filesystem::path beside(const std::filesystem::path& path, std::string_view suffix) {
  return path.native() + std::string{suffix};
}

}  // namespace

Statement::Statement(sqlite3_stmt* statement, const Database& database)
    : statement_{statement}, database_{&database} {}

Result<bool> Statement::step() {
  switch (sqlite3_step(statement_.get())) {
    case SQLITE_ROW:
      return true;
    case SQLITE_DONE:
      return false;
    default:
      return database_->failure("reading");
  }
}

Result<void> Statement::run() {
  const bool done = sqlite3_step(statement_.get()) == SQLITE_DONE;
  Result<void> result{};
  if (!done) {
    result = database_->failure("writing");
  }
  reset();
  return result;
}

void Statement::reset() {
  sqlite3_reset(statement_.get());
}

Statement& Statement::bind(int parameter, std::int64_t value) {
  sqlite3_bind_int64(statement_.get(), parameter, value);
  return *this;
}

Statement& Statement::bind(int parameter, std::string_view text) {
  sqlite3_bind_text64(statement_.get(), parameter, text.data(), text.size(), SQLITE_STATIC,
                      SQLITE_UTF8);
  return *this;
}

Statement& Statement::bind(int parameter, std::span<const std::byte> bytes) {
  sqlite3_bind_blob64(statement_.get(), parameter, bytes.data(), bytes.size(), SQLITE_STATIC);
  return *this;
}

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

std::string_view Statement::text(int column) const {
  const void* text = sqlite3_column_text(statement_.get(), column);
  if (text == nullptr) {
    return {};
  }
  return {static_cast<const char*>(text),
          static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

std::span<const std::byte> Statement::bytes(int column) const {
  const void* first = sqlite3_column_blob(statement_.get(), column);
  if (first == nullptr) {
    return {};
  }
  return {static_cast<const std::byte*>(first),
          static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

Result<void> Database::open(const std::string& uri, int flags) {
  sqlite3* database = nullptr;
  const int code = sqlite3_open_v2(uri.c_str(), &database,
                                   flags | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX, nullptr);
  database_.reset(database);
  if (code != SQLITE_OK) {
    return failure("cannot be opened");
  }
  sqlite3_extended_result_codes(database, 1);
  return {};
}

Result<std::unique_ptr<Database>> Database::open_read_only(const std::filesystem::path& path) {
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  if (error) {
    return fail(ErrorCode::kNotFound, "{}", error.message());
  }
  if (has_content(beside(path, "-journal"))) {
    return fail(ErrorCode::kUnavailable,
                "a transaction was interrupted and its journal lies beside the file; open a copy "
                "of both once with the "
                "sqlite3 program, which rolls it back");
  }
  std::unique_ptr<Database> database{new Database};
  const bool has_log = has_content(beside(path, "-wal"));
  // Without a lock (unix-none) and in exclusive mode, SQLite keeps the index of the log in memory
  // instead of writing it beside the file.
  const std::string_view mode = has_log ? "mode=ro&vfs=unix-none" : "mode=ro&immutable=1";
  if (auto opened = database->open(fmt::format("file:{}?{}", percent_encoded(path), mode),
                                   SQLITE_OPEN_READONLY);
      !opened) {
    return tl::unexpected{std::move(opened).error()};
  }
  database->work_left_ = kWorkFloor + kWorkPerFileByte * size;
  database->distrust();
  if (has_log) {
    sqlite3_db_config(database->database_.get(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
    if (auto exclusive = database->execute("PRAGMA locking_mode=EXCLUSIVE"); !exclusive) {
      return tl::unexpected{std::move(exclusive).error()};
    }
  }
  return database;
}

void Database::distrust() {
  sqlite3* const database = database_.get();
  sqlite3_db_config(database, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(database, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(database, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_db_config(database, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  sqlite3_limit(database, SQLITE_LIMIT_LENGTH, kMaxValueBytes);
  sqlite3_progress_handler(database, kWorkQuantum, count_work, this);
}

int Database::count_work(void* self) {
  auto& left = static_cast<Database*>(self)->work_left_;
  if (left < static_cast<std::uint64_t>(kWorkQuantum)) {
    return 1;  // makes the statement fail with SQLITE_INTERRUPT
  }
  left -= kWorkQuantum;
  return 0;
}

Result<std::unique_ptr<Database>> Database::create(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    return fail(ErrorCode::kInvalidArgument, "exists already");
  }
  std::unique_ptr<Database> database{new Database};
  if (auto opened = database->open(fmt::format("file:{}", percent_encoded(path)),
                                   SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
      !opened) {
    return tl::unexpected{std::move(opened).error()};
  }
  return database;
}

Result<Statement> Database::prepare(std::string_view sql) const {
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v2(database_.get(), sql.data(), static_cast<int>(sql.size()),
                                      &statement, nullptr);
  if (code != SQLITE_OK) {
    return failure("is not a bag");
  }
  return Statement{statement, *this};
}

Result<void> Database::execute(std::string_view sql) const {
  auto statement = prepare(sql);
  if (!statement) {
    return tl::unexpected{std::move(statement).error()};
  }
  Result<bool> more = true;
  while (more && *more) {
    more = statement->step();
  }
  if (!more) {
    return tl::unexpected{std::move(more).error()};
  }
  return {};
}

std::int64_t Database::last_insert_id() const {
  return sqlite3_last_insert_rowid(database_.get());
}

tl::unexpected<Error> Database::failure(std::string_view what) const {
  constexpr int kPrimaryCode = 0xff;
  const int code = sqlite3_errcode(database_.get()) & kPrimaryCode;
  if (code == SQLITE_INTERRUPT) {
    return fail(ErrorCode::kInvalidData, "{}: the database's pages lead in circles", what);
  }
  const bool by_system = code == SQLITE_CANTOPEN || code == SQLITE_IOERR || code == SQLITE_FULL ||
                         code == SQLITE_PERM || code == SQLITE_READONLY || code == SQLITE_NOMEM;
  return fail(by_system ? ErrorCode::kSystem : ErrorCode::kInvalidData, "{}: {}", what,
              sqlite3_errmsg(database_.get()));
}

}  // namespace geoflow::drivers::bag
