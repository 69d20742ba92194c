#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "geoflow/hal/result.hpp"

#include "replay/bag/metadata.hpp"

namespace geoflow::drivers::bag {

/// What all storages have in common: the folder of a bag that is being written, and what its
/// description will say. Thread-compatible.
class BagFolder {
 public:
  /// Makes the folder. `storage` is rosbag2's name of the storage, `extension` that of its files.
  /// kInvalidArgument where it exists, kSystem.
  [[nodiscard]] static Result<BagFolder> create(const std::filesystem::path& directory,
                                                std::string_view storage,
                                                std::string_view extension,
                                                std::map<std::string, std::string> custom_data);

  /// The one file of messages, NAME/NAME_0.EXTENSION; not made here.
  [[nodiscard]] const std::filesystem::path& file() const noexcept { return file_; }
  [[nodiscard]] const Metadata& metadata() const noexcept { return metadata_; }
  /// Messages are compressed one by one.
  void set_message_compression();

  /// The index in metadata().topics of a new topic.
  [[nodiscard]] std::size_t add_topic(const std::string& name, std::string_view type, bool latched);
  void count(std::size_t topic, std::int64_t timestamp_ns);

  /// Writes metadata.yaml, whole or not at all.
  [[nodiscard]] Result<void> write_description() const;

 private:
  BagFolder() = default;
  std::filesystem::path directory_;
  std::filesystem::path file_;
  Metadata metadata_;
};

}  // namespace geoflow::drivers::bag
