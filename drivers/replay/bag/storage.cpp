#include "replay/bag/storage.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/types.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "replay/bag/metadata.hpp"
#include "replay/bag/sqlite.hpp"
#include "replay/bag/zstd_codec.hpp"

namespace geoflow::drivers::bag {
namespace {

namespace fs = std::filesystem;

// In this order. WAL with NORMAL is rosbag2's own "resilient" profile: after a power cut the
// database is whole up to a recent transaction. Large pages, because an image then lies on few of
// them; the log is folded in every 64 MiB.
constexpr std::array kPragmas{
    "PRAGMA page_size=32768",
    "PRAGMA journal_mode=WAL",
    "PRAGMA synchronous=NORMAL",
    "PRAGMA wal_autocheckpoint=2048",
};

constexpr std::array kSchema{
    "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)",
    "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata "
    "TEXT NOT NULL)",
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
    "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL, type_description_hash "
    "TEXT NOT NULL)",
    "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding "
    "TEXT NOT NULL, "
    "encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL)",
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER "
    "NOT NULL, "
    "data BLOB NOT NULL)",
    "CREATE INDEX timestamp_idx ON messages (timestamp ASC)",
    "INSERT INTO schema (schema_version, ros_distro) VALUES (4, 'geoflow')",
};

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

Storage::Storage(StorageOptions options) : options_{std::move(options)} {
  metadata_.custom_data = options_.custom_data;
  if (options_.compression_level) {
    compressor_.emplace(*options_.compression_level);
    metadata_.compression_format = "zstd";
    metadata_.compression_mode = "MESSAGE";
  }
}

Result<std::unique_ptr<Storage>> Storage::create(const StorageOptions& options) {
  std::unique_ptr<Storage> storage{new Storage{options}};
  if (auto created = storage->create_files(); !created) {
    return tl::unexpected{std::move(created).error()};
  }
  return storage;
}

Result<void> Storage::create_files() {
  // A path that ends with a slash has an empty last part.
  const fs::path folder =
      options_.directory.has_filename() ? options_.directory : options_.directory.parent_path();
  std::error_code error;
  if (fs::exists(folder, error)) {
    return fail(ErrorCode::kInvalidArgument, "{}: exists already; a recording needs a new folder",
                folder.native());
  }
  if (!fs::create_directories(folder, error)) {
    return fail(ErrorCode::kSystem, "{}: cannot be made: {}", folder.native(), error.message());
  }
  options_.directory = folder;
  const std::string name = folder.filename().native() + "_0.db3";
  database_path_ = folder / name;
  metadata_.relative_file_paths = {name};
  metadata_.files = {{.path = name}};
  auto database = Database::create(database_path_);
  if (!database) {
    return tl::unexpected{std::move(database).error().in(database_path_.native())};
  }
  database_ = std::move(*database);
  Result<void> done{};
  for (const char* sql : kPragmas) {
    done = done.and_then([&] { return database_->execute(sql); });
  }
  for (const char* sql : kSchema) {
    done = done.and_then([&] { return database_->execute(sql); });
  }
  auto stored = done.and_then([this] { return store_metadata(); }).and_then([this] {
    return database_->prepare("INSERT INTO messages (timestamp, topic_id, data) VALUES (?, ?, ?)");
  });
  if (!stored) {
    return tl::unexpected{std::move(stored).error().in(database_path_.native())};
  }
  insert_ = std::move(*stored);
  return {};
}

Result<Storage::Topic> Storage::add_topic(const std::string& name, std::string_view type,
                                          bool latched) {
  metadata_.topics.push_back({.name = name,
                              .type = std::string{type},
                              .offered_qos_profiles = qos(latched),
                              .message_count = 0});
  const TopicMetadata& topic = metadata_.topics.back();
  auto added =
      database_
          ->prepare(
              "INSERT INTO topics (name, type, serialization_format, offered_qos_profiles, "
              "type_description_hash) VALUES (?, ?, ?, ?, '')")
          .and_then([&topic](Statement statement) {
            return statement.bind(1, std::string_view{topic.name})
                .bind(2, std::string_view{topic.type})
                .bind(3, std::string_view{topic.serialization_format})
                .bind(4, std::string_view{topic.offered_qos_profiles})
                .run();
          });
  if (!added) {
    return tl::unexpected{std::move(added).error()};
  }
  const Topic entry{.id = database_->last_insert_id(), .index = metadata_.topics.size() - 1};
  topics_.emplace(name, entry);
  return entry;
}

Result<void> Storage::write(const std::string& topic, std::string_view type,
                            std::int64_t timestamp_ns, std::span<const std::byte> message,
                            bool latched) {
  if (!insert_) {
    return fail(ErrorCode::kInvalidArgument, "{}: is closed", database_path_.native());
  }
  if (!in_transaction_) {
    if (auto begun = database_->execute("BEGIN"); !begun) {
      return named(std::move(begun));
    }
    in_transaction_ = true;
    transaction_start_ns_ = timestamp_ns;
    transaction_bytes_ = 0;
  }
  std::vector<std::byte> compressed;
  if (compressor_) {
    auto frame = compressor_->compress(message);
    if (!frame) {
      return named(tl::unexpected{std::move(frame).error()});
    }
    compressed = std::move(*frame);
    message = compressed;
  }
  const auto known = topics_.find(topic);
  const auto entry =
      known != topics_.end() ? Result<Topic>{known->second} : add_topic(topic, type, latched);
  if (!entry) {
    return named(tl::unexpected{entry.error()});
  }
  if (auto done = insert_->bind(1, timestamp_ns).bind(2, entry->id).bind(3, message).run(); !done) {
    return named(std::move(done));
  }
  count(*entry, timestamp_ns);
  return named(commit_if_due(timestamp_ns, message.size()));
}

void Storage::count(const Topic& topic, std::int64_t timestamp_ns) {
  const bool first = metadata_.message_count == 0;
  const std::int64_t start = first ? timestamp_ns : std::min(metadata_.start_ns, timestamp_ns);
  const std::int64_t end =
      first ? timestamp_ns : std::max(metadata_.start_ns + metadata_.duration_ns, timestamp_ns);
  metadata_.start_ns = start;
  metadata_.duration_ns = end - start;
  ++metadata_.message_count;
  ++metadata_.topics[topic.index].message_count;
}

Result<void> Storage::commit_if_due(std::int64_t timestamp_ns, std::size_t bytes) {
  transaction_bytes_ += bytes;
  const Duration open_for{timestamp_ns - transaction_start_ns_};
  if (open_for < options_.commit_after && transaction_bytes_ < options_.commit_after_bytes) {
    return {};
  }
  in_transaction_ = false;
  return database_->execute("COMMIT");
}

Result<void> Storage::store_metadata() {
  return database_->prepare("INSERT INTO metadata (metadata_version, metadata) VALUES (?, ?)")
      .and_then([this](Statement statement) {
        const std::string yaml = to_stored_yaml(metadata_);
        return statement.bind(1, std::int64_t{metadata_.version})
            .bind(2, std::string_view{yaml})
            .run();
      });
}

Result<void> Storage::close() {
  metadata_.files.front().start_ns = metadata_.start_ns;
  metadata_.files.front().duration_ns = metadata_.duration_ns;
  metadata_.files.front().message_count = metadata_.message_count;
  Result<void> done{};
  if (std::exchange(in_transaction_, false)) {
    done = database_->execute("COMMIT");
  }
  // Leaving WAL folds the log in and removes it: a closed bag is one file, also for readers on
  // read-only media.
  done = done.and_then([this] { return store_metadata(); }).and_then([this] {
    insert_.reset();
    return database_->execute("PRAGMA journal_mode=DELETE");
  });
  insert_.reset();
  database_.reset();
  if (!done) {
    return named(std::move(done));
  }
  return write_metadata_file();
}

Result<void> Storage::write_metadata_file() const {
  const fs::path target = options_.directory / "metadata.yaml";
  const fs::path fresh = options_.directory / "metadata.yaml.new";
  if (auto written = write_and_sync(fresh, to_yaml(metadata_)); !written) {
    return written;
  }
  if (std::rename(fresh.c_str(), target.c_str()) != 0) {
    return fail_errno(target.native());
  }
  const UniqueFd folder{::open(options_.directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (!folder || ::fsync(folder.get()) != 0) {
    return fail_errno(options_.directory.native());
  }
  return {};
}

Result<void> Storage::named(Result<void> result) const {
  if (!result) {
    return tl::unexpected{std::move(result).error().in(database_path_.native())};
  }
  return result;
}

}  // namespace geoflow::drivers::bag
