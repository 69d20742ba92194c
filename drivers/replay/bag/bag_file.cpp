#include "replay/bag/bag_file.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "replay/bag/sqlite.hpp"
#include "replay/bag/zstd_codec.hpp"

namespace geoflow::drivers::bag {
namespace {

/// The first bytes of a file; fewer where it is shorter, none where it cannot be read.
template <std::size_t Size>
std::string head_of(const std::filesystem::path& path) {
  std::string head(Size, '\0');
  std::ifstream file{path, std::ios::binary};
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  return head;
}

constexpr std::string_view kSqliteMagic{"SQLite format 3\0", 16};

}  // namespace

Result<std::unique_ptr<BagFile>> BagFile::open(const std::filesystem::path& path) {
  std::unique_ptr<BagFile> file{new BagFile{path}};
  auto opened = file->open_database().and_then([&] { return file->check_tables(); }).and_then([&] {
    return file->read_topics();
  });
  if (!opened) {
    return tl::unexpected{std::move(opened).error()};
  }
  return file;
}

Result<void> BagFile::open_database() {
  const std::string head = head_of<kSqliteMagic.size()>(path_);
  std::filesystem::path database_path = path_;
  if (is_zstd(std::as_bytes(std::span{head}))) {
    auto decompressed = decompress_file(path_, kMaxDecompressedBytes);
    if (!decompressed) {
      return tl::unexpected{std::move(decompressed).error()};
    }
    decompressed_ = std::move(*decompressed);
    database_path = decompressed_->path();
  } else if (head.empty()) {
    return fail(ErrorCode::kInvalidData, "{}: is empty or cannot be read", path_.native());
  } else if (!kSqliteMagic.starts_with(head)) {
    return fail(ErrorCode::kInvalidData, "{}: is neither an SQLite database nor a Zstandard file",
                path_.native());
  }
  auto database = Database::open_read_only(database_path);
  if (!database) {
    return tl::unexpected{in_this_file(std::move(database).error())};
  }
  database_ = std::move(*database);
  return {};
}

Result<void> BagFile::check_tables() {
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
                path_.native());
  }
  return {};
}

Result<void> BagFile::read_topics() {
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
    topics_.push_back({.id = rows->integer(0),
                       .name = std::string{rows->text(1)},
                       .type = std::string{rows->text(2)},
                       .serialization_format = std::string{rows->text(3)}});
  }
}

Result<BagFile::Extent> BagFile::extent() {
  Extent extent;
  extent.counts.resize(topics_.size());
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

Result<std::optional<std::int64_t>> BagFile::start_ns() {
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

std::optional<std::string> BagFile::stored_metadata() {
  auto row = database_->prepare("SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1");
  if (!row || !row->step().value_or(false)) {
    return std::nullopt;
  }
  return std::string{row->text(0)};
}

Result<void> BagFile::select(const std::function<bool(const FileTopic&)>& wanted) {
  std::string ids;
  for (const FileTopic& topic : topics_) {
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

Result<std::optional<MessageRow>> BagFile::next() {
  while (rows_) {
    const auto found = rows_->step();
    if (!found) {
      rows_.reset();
      return fail(
          ErrorCode::kInvalidData, "{}: {}: {}", path_.native(),
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

Result<std::span<const std::byte>> BagFile::data(const MessageRow& row) {
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

std::string BagFile::describe(const MessageRow& row) const {
  return fmt::format("{}: message {} ({})", path_.native(), row.number, topics_[row.topic].name);
}

std::optional<std::size_t> BagFile::index_of(std::int64_t topic_id) const {
  const auto found = std::ranges::lower_bound(topics_, topic_id, {}, &FileTopic::id);
  if (found == topics_.end() || found->id != topic_id) {
    return std::nullopt;
  }
  return static_cast<std::size_t>(found - topics_.begin());
}

Error BagFile::in_this_file(Error error) const {
  return std::move(error).in(path_.native());
}

}  // namespace geoflow::drivers::bag
