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

namespace geoflow::drivers::bag {

/// One topic of one file.
struct FileTopic {
  std::int64_t id = 0;
  std::string name;
  std::string type;
  std::string serialization_format;
};

/// Where a message stands and when it was recorded.
struct MessageRow {
  /// Counts from 1: in SQLite its row id, in MCAP its place among those asked for, by time.
  std::int64_t number = 0;
  std::int64_t timestamp_ns = 0;
  std::size_t topic = 0;  ///< index into topics()
};

/// One file of a bag, in whichever storage. Thread-bound.
class BagFile {
 public:
  /// The storage is recognised by the first bytes: SQLite (also compressed as a whole) or MCAP.
  [[nodiscard]] static Result<std::unique_ptr<BagFile>> open(const std::filesystem::path& path);

  BagFile(const BagFile&) = delete;
  BagFile& operator=(const BagFile&) = delete;
  virtual ~BagFile() = default;

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] const std::vector<FileTopic>& topics() const noexcept { return topics_; }

  struct Extent {
    std::int64_t start_ns = 0;
    std::int64_t end_ns = 0;
    std::vector<std::uint64_t> counts;  ///< of messages, in the order of topics()
  };
  /// From when to when, and how many messages.
  [[nodiscard]] virtual Result<Extent> extent() = 0;
  /// The time of the first message; none in an empty file.
  [[nodiscard]] virtual Result<std::optional<std::int64_t>> start_ns() = 0;
  /// The newest copy of metadata.yaml in the file; none where it has none.
  [[nodiscard]] virtual std::optional<std::string> stored_metadata() = 0;

  /// Begins reading the messages of the wanted topics, ordered by time, then by number.
  [[nodiscard]] virtual Result<void> select(
      const std::function<bool(const FileTopic&)>& wanted) = 0;
  /// The next row of the selection; none at its end. After an error it goes on behind what is
  /// damaged, or is at its end.
  [[nodiscard]] virtual Result<std::optional<MessageRow>> next() = 0;
  /// The message that next() returned last, decompressed; valid until the next call.
  [[nodiscard]] virtual Result<std::span<const std::byte>> data(const MessageRow& row) = 0;

  /// `FILE: message N (TOPIC)`, for errors.
  [[nodiscard]] std::string describe(const MessageRow& row) const;

 protected:
  explicit BagFile(std::filesystem::path path) : path_{std::move(path)} {}
  void add_topic(FileTopic topic) { topics_.push_back(std::move(topic)); }
  /// The place in topics() of the topic with that id.
  [[nodiscard]] std::optional<std::size_t> index_of(std::int64_t topic_id) const;
  [[nodiscard]] Error in_this_file(Error error) const;

 private:
  std::filesystem::path path_;
  std::vector<FileTopic> topics_;
};

}  // namespace geoflow::drivers::bag
