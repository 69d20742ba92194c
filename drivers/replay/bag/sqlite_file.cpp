#include "replay/bag/sqlite_file.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <ios>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "replay/bag/bag_file.hpp"
#include "replay/bag/sqlite.hpp"
#include "replay/bag/zstd_codec.hpp"

namespace geoflow::drivers::bag {
namespace {

constexpr std::string_view kSqliteMagic{"SQLite format 3\0", 16};
constexpr std::size_t kSqliteHeaderBytes = 100;

/// The first bytes of a file; fewer where it is shorter, none where it cannot be read.
std::string head_of(const std::filesystem::path& path) {
  std::string head(kSqliteHeaderBytes, '\0');
  std::ifstream file{path, std::ios::binary};
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  return head;
}

std::uint64_t big_endian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (const char c : bytes) {
    value = value * 256U + static_cast<unsigned char>(c);
  }
  return value;
}

/// How many bytes the database has by its own header (SQLite file format, 1.3); 0 where that does
/// not say.
std::uint64_t stated_size(std::string_view head) {
  const std::string_view header = head.substr(0, kSqliteHeaderBytes);
  constexpr std::size_t kPageSizeAt = 16;
  constexpr std::size_t kChangeCounterAt = 24;
  constexpr std::size_t kPageCountAt = 28;
  constexpr std::size_t kValidForAt = 92;
  if (header.size() < kSqliteHeaderBytes ||
      header.substr(kChangeCounterAt, 4) != header.substr(kValidForAt, 4)) {
    return 0;
  }
  const std::uint64_t page_size = big_endian(header.substr(kPageSizeAt, 2));
  return big_endian(header.substr(kPageCountAt, 4)) * (page_size == 1 ? 1U << 16U : page_size);
}

Result<void> check_size(std::string_view head, const std::filesystem::path& path) {
  // Pages may still be in the log of a writer that did not end well.
  std::error_code error;
  const bool has_log = std::filesystem::exists(path.native() + "-wal", error);
  const std::uint64_t size = std::filesystem::file_size(path, error);
  if (!has_log && !error && size < std::max<std::uint64_t>(stated_size(head), kSqliteHeaderBytes)) {
    return fail(ErrorCode::kInvalidData,
                "is cut off: {} bytes are there, {} belong to the database", size,
                stated_size(head));
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<BagFile>> SqliteFile::open(const std::filesystem::path& path) {
  std::unique_ptr<SqliteFile> file{new SqliteFile{path}};
  auto opened = file->open_database().and_then([&] { return file->check_tables(); }).and_then([&] {
    return file->read_topics();
  });
  if (!opened) {
    return tl::unexpected{std::move(opened).error()};
  }
  return std::unique_ptr<BagFile>{std::move(file)};
}

Result<void> SqliteFile::open_database() {
  std::string head = head_of(path());
  std::filesystem::path database_path = path();
  if (is_zstd(std::as_bytes(std::span{head}))) {
    auto decompressed = decompress_file(path(), kMaxDecompressedBytes);
    if (!decompressed) {
      return tl::unexpected{std::move(decompressed).error()};
    }
    decompressed_ = std::move(*decompressed);
    database_path = decompressed_->path();
    head = head_of(database_path);
  }
  if (head.empty()) {
    return fail(ErrorCode::kInvalidData, "{}: is empty or cannot be read", path().native());
  }
  if (!kSqliteMagic.starts_with(std::string_view{head}.substr(0, kSqliteMagic.size()))) {
    return fail(ErrorCode::kInvalidData, "{}: is neither an SQLite database nor a Zstandard file",
                path().native());
  }
  auto database = check_size(head, database_path).and_then([&] {
    return Database::open_read_only(database_path);
  });
  if (!database) {
    return tl::unexpected{in_this_file(std::move(database).error())};
  }
  database_ = std::move(*database);
  return {};
}

Result<void> SqliteFile::check_tables() {
  // A view or a virtual table under the name of a table is no bag, and could run for ever.
  auto tables = database_->prepare(
      "SELECT COUNT(*) FROM sqlite_master WHERE type = 'table' AND rootpage > 0 AND name IN "
      "('topics', 'messages')");
  if (!tables) {
    return tl::unexpected{in_this_file(std::move(tables).error())};
  }
  const auto row = tables->step();
  if (!row) {
    return tl::unexpected{in_this_file(row.error())};
  }
  if (tables->integer(0) != 2) {
    return fail(ErrorCode::kInvalidData,
                "{}: is an SQLite database, but has no tables topics and messages: not a bag",
                path().native());
  }
  return {};
}

Result<void> SqliteFile::read_topics() {
  auto rows =
      database_->prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
  if (!rows) {
    return tl::unexpected{in_this_file(std::move(rows).error())};
  }
  while (true) {
    const auto row = rows->step();
    if (!row) {
      return tl::unexpected{in_this_file(row.error())};
    }
    if (!*row) {
      return {};
    }
    add_topic({.id = rows->integer(0),
               .name = std::string{rows->text(1)},
               .type = std::string{rows->text(2)},
               .serialization_format = std::string{rows->text(3)}});
  }
}

Result<BagFile::Extent> SqliteFile::extent() {
  Extent extent;
  extent.counts.resize(topics().size());
  auto rows = database_->prepare(
      "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY topic_id");
  if (!rows) {
    return tl::unexpected{in_this_file(std::move(rows).error())};
  }
  bool first = true;
  while (true) {
    const auto row = rows->step();
    if (!row) {
      return tl::unexpected{in_this_file(row.error())};
    }
    if (!*row) {
      return extent;
    }
    if (const auto topic = index_of(rows->integer(0))) {
      extent.counts[*topic] += static_cast<std::uint64_t>(rows->integer(1));
      extent.start_ns = first ? rows->integer(2) : std::min(extent.start_ns, rows->integer(2));
      extent.end_ns = first ? rows->integer(3) : std::max(extent.end_ns, rows->integer(3));
      first = false;
    }
  }
}

Result<std::optional<std::int64_t>> SqliteFile::start_ns() {
  auto row = database_->prepare("SELECT timestamp FROM messages ORDER BY timestamp LIMIT 1");
  if (!row) {
    return tl::unexpected{in_this_file(std::move(row).error())};
  }
  const auto found = row->step();
  if (!found) {
    return tl::unexpected{in_this_file(found.error())};
  }
  return *found ? std::optional{row->integer(0)} : std::nullopt;
}

std::optional<std::string> SqliteFile::stored_metadata() {
  auto row = database_->prepare("SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1");
  if (!row || !row->step().value_or(false)) {
    return std::nullopt;
  }
  return std::string{row->text(0)};
}

Result<void> SqliteFile::select(const std::function<bool(const FileTopic&)>& wanted) {
  std::string ids;
  for (const FileTopic& topic : topics()) {
    if (wanted(topic)) {
      ids += fmt::format("{}{}", ids.empty() ? "" : ",", topic.id);
    }
  }
  // Without the data: it is fetched by number, so that one damaged message does not end the
  // reading, and so that an old file without the index on time is sorted by its times alone.
  auto rows = database_->prepare(fmt::format(
      "SELECT id, timestamp, topic_id FROM messages WHERE topic_id IN ({}) ORDER BY timestamp, id",
      ids));
  auto data = database_->prepare("SELECT data FROM messages WHERE id = ?");
  if (!rows || !data) {
    return tl::unexpected{in_this_file(rows ? std::move(data).error() : std::move(rows).error())};
  }
  rows_ = std::move(*rows);
  data_ = std::move(*data);
  last_number_.reset();
  return {};
}

Result<std::optional<MessageRow>> SqliteFile::next() {
  while (rows_) {
    const auto found = rows_->step();
    if (!found) {
      rows_.reset();
      return fail(
          ErrorCode::kInvalidData, "{}: {}: {}", path().native(),
          last_number_ ? fmt::format("behind message {}", *last_number_) : "at the first message",
          found.error().message);
    }
    if (!*found) {
      rows_.reset();
      break;
    }
    if (const auto topic = index_of(rows_->integer(2))) {
      last_number_ = rows_->integer(0);
      return MessageRow{
          .number = *last_number_, .timestamp_ns = rows_->integer(1), .topic = *topic};
    }
  }
  return std::nullopt;
}

Result<std::span<const std::byte>> SqliteFile::data(const MessageRow& row) {
  if (!data_) {
    return fail(ErrorCode::kInvalidArgument, "{}: no topics were selected", describe(row));
  }
  data_->reset();
  const auto found = data_->bind(1, row.number).step();
  if (!found) {
    return tl::unexpected{Error{found.error()}.in(describe(row))};
  }
  if (!*found) {
    return fail(ErrorCode::kInvalidData, "{}: is in the index but not in the table", describe(row));
  }
  const auto stored = data_->bytes(0);
  if (!is_zstd(stored)) {
    return stored;
  }
  auto content = decompress(stored);
  if (!content) {
    return tl::unexpected{std::move(content).error().in(describe(row))};
  }
  buffer_ = std::move(*content);
  return std::span<const std::byte>{buffer_};
}

}  // namespace geoflow::drivers::bag
