#include "replay/bag/metadata.hpp"

#include <cstdint>
#include <string>
#include <string_view>

#include <yaml-cpp/yaml.h>

#include "geoflow/hal/result.hpp"

namespace geoflow::drivers::bag {
namespace {

template <typename T>
void read_if_there(const YAML::Node& node, const char* key, T& value) {
  if (const YAML::Node member = node[key]; member && !member.IsNull()) {
    value = member.as<T>();
  }
}

void read_time(const YAML::Node& node, const char* key, const char* unit, std::int64_t& value) {
  if (const YAML::Node member = node[key]; member && member.IsMap()) {
    read_if_there(member, unit, value);
  }
}

constexpr const char* kEpoch = "nanoseconds_since_epoch";
constexpr const char* kNanoseconds = "nanoseconds";

TopicMetadata topic_of(const YAML::Node& node) {
  TopicMetadata topic;
  const YAML::Node described = node["topic_metadata"];
  topic.name = described["name"].as<std::string>();
  topic.type = described["type"].as<std::string>();
  read_if_there(described, "serialization_format", topic.serialization_format);
  read_if_there(node, "message_count", topic.message_count);
  return topic;
}

FileMetadata file_of(const YAML::Node& node) {
  FileMetadata file;
  file.path = node["path"].as<std::string>();
  read_time(node, "starting_time", kEpoch, file.start_ns);
  read_time(node, "duration", kNanoseconds, file.duration_ns);
  read_if_there(node, "message_count", file.message_count);
  return file;
}

Metadata metadata_of(const YAML::Node& node) {
  Metadata metadata;
  metadata.version = node["version"].as<int>();
  metadata.storage_identifier = node["storage_identifier"].as<std::string>();
  read_time(node, "starting_time", kEpoch, metadata.start_ns);
  read_time(node, "duration", kNanoseconds, metadata.duration_ns);
  read_if_there(node, "message_count", metadata.message_count);
  for (const YAML::Node& topic : node["topics_with_message_count"]) {
    metadata.topics.push_back(topic_of(topic));
  }
  read_if_there(node, "compression_format", metadata.compression_format);
  read_if_there(node, "compression_mode", metadata.compression_mode);
  read_if_there(node, "relative_file_paths", metadata.relative_file_paths);
  for (const YAML::Node& file : node["files"]) {
    metadata.files.push_back(file_of(file));
  }
  read_if_there(node, "custom_data", metadata.custom_data);
  return metadata;
}

YAML::Node time_node(const char* unit, std::int64_t value) {
  YAML::Node node;
  node[unit] = value;
  return node;
}

YAML::Node quoted(const std::string& text) {
  YAML::Node node{text};
  node.SetTag("!");  // yaml-cpp's mark for a quoted scalar: an empty one must not read back as null
  return node;
}

YAML::Node node_of(const TopicMetadata& topic) {
  YAML::Node node;
  YAML::Node described = node["topic_metadata"];
  described["name"] = topic.name;
  described["type"] = topic.type;
  described["serialization_format"] = topic.serialization_format;
  described["offered_qos_profiles"] = quoted(topic.offered_qos_profiles);
  described["type_description_hash"] = quoted({});
  node["message_count"] = topic.message_count;
  return node;
}

YAML::Node node_of(const FileMetadata& file) {
  YAML::Node node;
  node["path"] = file.path;
  node["starting_time"] = time_node(kEpoch, file.start_ns);
  node["duration"] = time_node(kNanoseconds, file.duration_ns);
  node["message_count"] = file.message_count;
  return node;
}

YAML::Node node_of(const Metadata& metadata) {
  YAML::Node node;
  node["version"] = metadata.version;
  node["storage_identifier"] = metadata.storage_identifier;
  node["duration"] = time_node(kNanoseconds, metadata.duration_ns);
  node["starting_time"] = time_node(kEpoch, metadata.start_ns);
  node["message_count"] = metadata.message_count;
  node["topics_with_message_count"] = YAML::Node{YAML::NodeType::Sequence};
  for (const TopicMetadata& topic : metadata.topics) {
    node["topics_with_message_count"].push_back(node_of(topic));
  }
  node["compression_format"] = quoted(metadata.compression_format);
  node["compression_mode"] = quoted(metadata.compression_mode);
  node["relative_file_paths"] = metadata.relative_file_paths;
  node["files"] = YAML::Node{YAML::NodeType::Sequence};
  for (const FileMetadata& file : metadata.files) {
    node["files"].push_back(node_of(file));
  }
  node["custom_data"] = YAML::Node{YAML::NodeType::Map};
  for (const auto& [key, value] : metadata.custom_data) {
    node["custom_data"][key] = value;
  }
  node["ros_distro"] = "geoflow";
  return node;
}

constexpr const char* kRoot = "rosbag2_bagfile_information";

}  // namespace

Result<Metadata> parse_metadata(const std::string& yaml, std::string_view origin) {
  try {
    const YAML::Node root = YAML::Load(yaml);
    // The copy inside a database file stands without the root key.
    return metadata_of(root.IsMap() && root[kRoot] ? root[kRoot] : root);
  } catch (const YAML::Exception& error) {
    return fail(ErrorCode::kInvalidData, "{}:{}: {}", origin, error.mark.line + 1, error.msg);
  }
}

std::string to_yaml(const Metadata& metadata) {
  YAML::Node root;
  root[kRoot] = node_of(metadata);
  return YAML::Dump(root) + "\n";
}

std::string to_stored_yaml(const Metadata& metadata) {
  return YAML::Dump(node_of(metadata));
}

}  // namespace geoflow::drivers::bag
