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

#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::drivers::bag {

struct StorageOptions {
  std::filesystem::path directory;
  BagStorage storage = BagStorage::kSqlite;
  std::optional<int> compression_level{};  ///< none: messages as they are
  Duration commit_after{};
  std::size_t commit_after_bytes = 0;
  std::map<std::string, std::string> custom_data{};
};

/// The files of a bag that is being written. Thread-bound.
class Storage {
 public:
  /// kInvalidArgument where the folder exists.
  [[nodiscard]] static Result<std::unique_ptr<Storage>> create(const StorageOptions& options);

  Storage() = default;
  Storage(const Storage&) = delete;
  Storage& operator=(const Storage&) = delete;
  virtual ~Storage() = default;

  /// Appends a serialised message; the topic is entered with its first one. `latched`: offered to
  /// late subscribers too.
  [[nodiscard]] virtual Result<void> write(const std::string& topic, std::string_view type,
                                           std::int64_t timestamp_ns,
                                           std::span<const std::byte> message, bool latched) = 0;
  /// Ends the files; at the end there is NAME/metadata.yaml. Nothing is written afterwards.
  [[nodiscard]] virtual Result<void> close() = 0;
};

/// NAME/NAME_0.db3 in the schema of rosbag2_storage_sqlite3 (version 4).
[[nodiscard]] Result<std::unique_ptr<Storage>> create_sqlite_storage(const StorageOptions& options);
/// NAME/NAME_0.mcap with the profile `ros2`, as rosbag2_storage_mcap writes it.
[[nodiscard]] Result<std::unique_ptr<Storage>> create_mcap_storage(const StorageOptions& options);

}  // namespace geoflow::drivers::bag
