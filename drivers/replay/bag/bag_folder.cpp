#include "replay/bag/bag_folder.hpp"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/types.h>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "replay/bag/metadata.hpp"

namespace geoflow::drivers::bag {
namespace {

namespace fs = std::filesystem;

// rmw's numbers: history 1 keep last, reliability 1 reliable, durability 1 transient local or 2
// volatile, liveliness 1 automatic; the durations are rmw's infinite.
std::string qos(bool latched) {
  constexpr const char* kInfinite = "\n    sec: 9223372036\n    nsec: 854775807";
  return fmt::format(
      "- history: 1\n  depth: 10\n  reliability: 1\n  durability: {0}\n  deadline:{1}\n  "
      "lifespan:{1}\n"
      "  liveliness: 1\n  liveliness_lease_duration:{1}\n  avoid_ros_namespace_conventions: false",
      latched ? 1 : 2, kInfinite);
}

Result<void> write_and_sync(const fs::path& path, std::string_view text) {
  constexpr mode_t kMode = 0644;
  const UniqueFd fd{::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, kMode)};
  if (!fd) {
    return fail_errno(path.native());
  }
  while (!text.empty()) {
    const ssize_t count = ::write(fd.get(), text.data(), text.size());
    if (count < 0 && errno != EINTR) {
      return fail_errno(path.native());
    }
    text.remove_prefix(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  }
  if (::fsync(fd.get()) != 0) {
    return fail_errno(path.native());
  }
  return {};
}

}  // namespace

Result<BagFolder> BagFolder::create(const fs::path& directory, std::string_view storage,
                                    std::string_view extension,
                                    std::map<std::string, std::string> custom_data) {
  // A path that ends with a slash has an empty last part.
  BagFolder folder;
  folder.directory_ = directory.has_filename() ? directory : directory.parent_path();
  std::error_code error;
  if (fs::exists(folder.directory_, error)) {
    return fail(ErrorCode::kInvalidArgument, "{}: exists already; a recording needs a new folder",
                folder.directory_.native());
  }
  if (!fs::create_directories(folder.directory_, error)) {
    return fail(ErrorCode::kSystem, "{}: cannot be made: {}", folder.directory_.native(),
                error.message());
  }
  const std::string name = fmt::format("{}_0.{}", folder.directory_.filename().native(), extension);
  folder.file_ = folder.directory_ / name;
  folder.metadata_.storage_identifier = storage;
  folder.metadata_.custom_data = std::move(custom_data);
  folder.metadata_.relative_file_paths = {name};
  folder.metadata_.files = {{.path = name}};
  return folder;
}

void BagFolder::set_message_compression() {
  metadata_.compression_format = "zstd";
  metadata_.compression_mode = "MESSAGE";
}

std::size_t BagFolder::add_topic(const std::string& name, std::string_view type, bool latched) {
  metadata_.topics.push_back({.name = name,
                              .type = std::string{type},
                              .offered_qos_profiles = qos(latched),
                              .message_count = 0});
  return metadata_.topics.size() - 1;
}

void BagFolder::count(std::size_t topic, std::int64_t timestamp_ns) {
  const bool first = metadata_.message_count == 0;
  const std::int64_t start = first ? timestamp_ns : std::min(metadata_.start_ns, timestamp_ns);
  const std::int64_t end =
      first ? timestamp_ns : std::max(metadata_.start_ns + metadata_.duration_ns, timestamp_ns);
  metadata_.start_ns = start;
  metadata_.duration_ns = end - start;
  ++metadata_.message_count;
  ++metadata_.topics[topic].message_count;
  FileMetadata& file = metadata_.files.front();
  file.start_ns = metadata_.start_ns;
  file.duration_ns = metadata_.duration_ns;
  file.message_count = metadata_.message_count;
}

Result<void> BagFolder::write_description() const {
  const fs::path target = directory_ / "metadata.yaml";
  const fs::path fresh = directory_ / "metadata.yaml.new";
  if (auto written = write_and_sync(fresh, to_yaml(metadata_)); !written) {
    return written;
  }
  if (std::rename(fresh.c_str(), target.c_str()) != 0) {
    return fail_errno(target.native());
  }
  const UniqueFd folder{::open(directory_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (!folder || ::fsync(folder.get()) != 0) {
    return fail_errno(directory_.native());
  }
  return {};
}

}  // namespace geoflow::drivers::bag
