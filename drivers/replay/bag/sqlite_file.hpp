#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "replay/bag/bag_file.hpp"
#include "replay/bag/sqlite.hpp"
#include "replay/bag/zstd_codec.hpp"

namespace geoflow::drivers::bag {

/// One .db3 file (or .db3.zstd, decompressed into a temporary file for as long as it is open).
/// Reads row by row; never holds more than one message. Thread-bound.
class SqliteFile final : public BagFile {
 public:
  /// Beyond this many bytes a compressed file is refused.
  static constexpr std::uint64_t kMaxDecompressedBytes = std::uint64_t{256} << 30U;

  [[nodiscard]] static Result<std::unique_ptr<BagFile>> open(const std::filesystem::path& path);

  /// Walks over all rows, without their data.
  [[nodiscard]] Result<Extent> extent() override;
  [[nodiscard]] Result<std::optional<std::int64_t>> start_ns() override;
  /// None before schema 3.
  [[nodiscard]] std::optional<std::string> stored_metadata() override;
  [[nodiscard]] Result<void> select(const std::function<bool(const FileTopic&)>& wanted) override;
  [[nodiscard]] Result<std::optional<MessageRow>> next() override;
  [[nodiscard]] Result<std::span<const std::byte>> data(const MessageRow& row) override;

 private:
  explicit SqliteFile(std::filesystem::path path) : BagFile{std::move(path)} {}
  [[nodiscard]] Result<void> open_database();
  [[nodiscard]] Result<void> check_tables();
  [[nodiscard]] Result<void> read_topics();

  std::optional<TemporaryFile> decompressed_;
  std::unique_ptr<Database> database_;
  std::optional<Statement> rows_;
  std::optional<Statement> data_;
  std::optional<std::int64_t> last_number_;
  std::vector<std::byte> buffer_;
};

}  // namespace geoflow::drivers::bag
