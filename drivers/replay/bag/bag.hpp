#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "replay/bag/bag_file.hpp"
#include "replay/bag/metadata.hpp"

namespace geoflow::drivers::bag {

struct BagTopic {
  std::string name;
  std::string type;
  std::uint64_t count = 0;
};

/// One message of a bag. The views are valid until the bag is asked for the next.
struct BagMessage {
  std::string_view topic;
  std::string_view type;
  std::int64_t timestamp_ns = 0;
  std::span<const std::byte> data;
  std::string origin;  ///< `FILE: message N (TOPIC)`
};

/// A rosbag2 recording: a folder with metadata.yaml and its files (SQLite or MCAP), a folder with
/// such files alone (their recorder was cut off before it wrote metadata.yaml), or one of them.
/// Messages come in order of time over all files, of which only those that overlap in time are open
/// at once. Thread-bound.
class Bag {
 public:
  /// Whether `path` is a bag by its names alone: a metadata.yaml, .db3 (.db3.zstd) or .mcap file in
  /// it, or such a file.
  [[nodiscard]] static bool looks_like_one(const std::filesystem::path& path);

  [[nodiscard]] static Result<std::unique_ptr<Bag>> open(const std::filesystem::path& path);

  [[nodiscard]] const std::vector<BagTopic>& topics() const noexcept { return topics_; }
  /// The topic of that name, or null.
  [[nodiscard]] const BagTopic* find(std::string_view name) const;
  [[nodiscard]] std::int64_t start_ns() const noexcept { return start_ns_; }
  [[nodiscard]] std::int64_t end_ns() const noexcept { return end_ns_; }
  [[nodiscard]] const std::map<std::string, std::string>& custom_data() const noexcept {
    return custom_data_;
  }

  /// For looking something up at the start: hands the messages of the wanted topics to `visit`,
  /// file after file, until `enough` says so at the end of one. What cannot be read is passed over.
  void scan(const std::function<bool(std::string_view)>& wanted,
            const std::function<void(const BagMessage&)>& visit,
            const std::function<bool()>& enough);

  /// Begins reading the wanted topics from the start.
  void select(std::function<bool(std::string_view)> wanted);
  /// The next message of the selection; none at the end. An error concerns one message, or one file
  /// from that message on: the next call goes on behind it.
  [[nodiscard]] Result<std::optional<BagMessage>> next();
  /// False once an error cost messages, or ended a file before its end.
  [[nodiscard]] bool complete() const noexcept { return complete_; }

 private:
  struct Part {
    std::filesystem::path path;
    std::int64_t start_ns = 0;
    std::shared_ptr<BagFile> file{};  ///< kept open from the start for the first part only
  };
  struct OpenPart {
    std::shared_ptr<BagFile> file;
    MessageRow row;
  };

  [[nodiscard]] Result<void> open_described(const std::filesystem::path& folder,
                                            const Metadata& metadata);
  [[nodiscard]] Result<void> open_scanned(const std::vector<std::filesystem::path>& files);
  void add(const BagFile& file, const BagFile::Extent& extent);
  [[nodiscard]] static Result<std::shared_ptr<BagFile>> open_part(const Part& part);
  [[nodiscard]] Result<void> open_due_parts();
  [[nodiscard]] Result<void> advance(std::size_t index);

  std::vector<BagTopic> topics_;
  std::int64_t start_ns_ = 0;
  std::int64_t end_ns_ = 0;
  std::map<std::string, std::string> custom_data_;
  std::vector<Part> parts_;  ///< by start
  std::function<bool(std::string_view)> wanted_;
  std::deque<Part> waiting_;
  std::vector<OpenPart> open_;
  std::optional<std::size_t>
      delivered_;  ///< the part whose row was delivered last and must move on
  bool complete_ = true;
};

}  // namespace geoflow::drivers::bag
