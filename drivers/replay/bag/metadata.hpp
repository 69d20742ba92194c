#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"

/// metadata.yaml, the description beside (and, from schema 3 on, inside) the database files of a
/// bag. Source: rosbag2_storage, yaml.hpp; versions 1 (Dashing) to 9 (Jazzy).
namespace geoflow::drivers::bag {

struct TopicMetadata {
  std::string name;
  std::string type;
  std::string serialization_format = "cdr";
  std::string offered_qos_profiles;  ///< YAML in a string, as versions 4 to 8 keep it; not read
  std::uint64_t message_count = 0;
};

struct FileMetadata {
  std::string path;  ///< relative to the bag's folder
  std::int64_t start_ns = 0;
  std::int64_t duration_ns = 0;
  std::uint64_t message_count = 0;
};

struct Metadata {
  int version = 8;
  std::string storage_identifier = "sqlite3";
  std::int64_t start_ns = 0;  ///< since the epoch of the recording's clock
  std::int64_t duration_ns = 0;
  std::uint64_t message_count = 0;
  std::vector<TopicMetadata> topics;
  std::string compression_format;  ///< empty or `zstd`
  std::string compression_mode;    ///< empty, `FILE` or `MESSAGE`
  std::vector<std::string> relative_file_paths;
  std::vector<FileMetadata> files;                 ///< empty before version 5
  std::map<std::string, std::string> custom_data;  ///< empty before version 6
};

/// Reads any version: what a version does not have keeps its default. Errors name `origin` and the
/// line.
[[nodiscard]] Result<Metadata> parse_metadata(const std::string& yaml, std::string_view origin);

/// As version 8, which every ROS 2 distribution from Humble on reads.
[[nodiscard]] std::string to_yaml(const Metadata& metadata);

/// The same for the metadata table inside a database file, which has no root key.
[[nodiscard]] std::string to_stored_yaml(const Metadata& metadata);

}  // namespace geoflow::drivers::bag
