#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "replay/bag/sqlite.hpp"
#include "replay/bag/zstd_codec.hpp"

namespace geoflow::drivers::bag {

/// One topic of one database file.
struct FileTopic {
  std::int64_t id = 0;
  std::string name;
  std::string type;
  std::string serialization_format;
};

/// Where a message stands and when it was recorded.
struct MessageRow {
  std::int64_t number = 0;  ///< its row id: counts from 1 in order of recording
  std::int64_t timestamp_ns = 0;
  std::size_t topic = 0;  ///< index into topics()
};

/// One .db3 file (or .db3.zstd, decompressed into a temporary file for as long as it is open).
/// Reads row by row; never holds more than one message. Thread-bound.
class BagFile {
 public:
  /// Beyond this many bytes a compressed file is refused.
  static constexpr std::uint64_t kMaxDecompressedBytes = std::uint64_t{256} << 30U;

  [[nodiscard]] static Result<std::unique_ptr<BagFile>> open(const std::filesystem::path& path);

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] const std::vector<FileTopic>& topics() const noexcept { return topics_; }

  struct Extent {
    std::int64_t start_ns = 0;
    std::int64_t end_ns = 0;
    std::vector<std::uint64_t> counts;  ///< of messages, in the order of topics()
  };
  /// Walks over all rows, without their data.
  [[nodiscard]] Result<Extent> extent();
  /// The time of the first message; none in an empty file.
  [[nodiscard]] Result<std::optional<std::int64_t>> start_ns();
  /// The newest copy of metadata.yaml in the file; none before schema 3.
  [[nodiscard]] std::optional<std::string> stored_metadata();

  /// Begins reading the messages of the wanted topics, ordered by time, then by number.
  [[nodiscard]] Result<void> select(const std::function<bool(const FileTopic&)>& wanted);
  /// The next row of the selection; none at its end and after an error.
  [[nodiscard]] Result<std::optional<MessageRow>> next();
  /// A message, decompressed where it is compressed; valid until the next call.
  [[nodiscard]] Result<std::span<const std::byte>> data(const MessageRow& row);

  /// `FILE: message N (TOPIC)`, for errors.
  [[nodiscard]] std::string describe(const MessageRow& row) const;

 private:
  explicit BagFile(std::filesystem::path path) : path_{std::move(path)} {}
  [[nodiscard]] Result<void> open_database();
  [[nodiscard]] Result<void> check_tables();
  [[nodiscard]] Result<void> read_topics();
  [[nodiscard]] std::optional<std::size_t> index_of(std::int64_t topic_id) const;
  [[nodiscard]] Error in_this_file(Error error) const;

  std::filesystem::path path_;
  std::optional<TemporaryFile> decompressed_;
  std::unique_ptr<Database> database_;
  std::vector<FileTopic> topics_;
  std::optional<Statement> rows_;
  std::optional<Statement> data_;
  std::optional<std::int64_t> last_number_;
  std::vector<std::byte> buffer_;
};

}  // namespace geoflow::drivers::bag
