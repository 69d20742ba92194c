#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/bag/metadata.hpp"
#include "replay/bag/sqlite.hpp"
#include "replay/bag/zstd_codec.hpp"

namespace geoflow::drivers::bag {

struct StorageOptions {
  std::filesystem::path directory;
  std::optional<int> compression_level{};  ///< none: messages as they are
  Duration commit_after{};
  std::size_t commit_after_bytes = 0;
  std::map<std::string, std::string> custom_data{};
};

/// The files of a bag that is being written: NAME/NAME_0.db3 in the schema of
/// rosbag2_storage_sqlite3 (version 4) and, at the end, NAME/metadata.yaml. Thread-bound.
class Storage {
 public:
  [[nodiscard]] static Result<std::unique_ptr<Storage>> create(const StorageOptions& options);

  /// Appends a serialised message; the topic is entered with its first one. `latched`: offered to
  /// late subscribers too.
  [[nodiscard]] Result<void> write(const std::string& topic, std::string_view type,
                                   std::int64_t timestamp_ns, std::span<const std::byte> message,
                                   bool latched = false);
  [[nodiscard]] Result<void> close();

 private:
  struct Topic {
    std::int64_t id = 0;
    std::size_t index = 0;  ///< into metadata_.topics
  };

  explicit Storage(StorageOptions options);
  [[nodiscard]] Result<void> create_files();
  [[nodiscard]] Result<Topic> add_topic(const std::string& name, std::string_view type,
                                        bool latched);
  [[nodiscard]] Result<void> store_metadata();
  [[nodiscard]] Result<void> write_metadata_file() const;
  [[nodiscard]] Result<void> commit_if_due(std::int64_t timestamp_ns, std::size_t bytes);
  void count(const Topic& topic, std::int64_t timestamp_ns);
  [[nodiscard]] Result<void> named(Result<void> result) const;

  StorageOptions options_;
  std::filesystem::path database_path_;
  Metadata metadata_;
  std::unique_ptr<Database> database_;
  std::optional<Statement> insert_;
  std::optional<Compressor> compressor_;
  std::map<std::string, Topic, std::less<>> topics_;
  std::int64_t transaction_start_ns_ = 0;
  std::size_t transaction_bytes_ = 0;
  bool in_transaction_ = false;
};

}  // namespace geoflow::drivers::bag
