#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/bag/bag_folder.hpp"
#include "replay/bag/metadata.hpp"
#include "replay/bag/sqlite.hpp"
#include "replay/bag/storage.hpp"
#include "replay/bag/zstd_codec.hpp"

namespace geoflow::drivers::bag {
namespace {

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

class SqliteStorage final : public Storage {
 public:
  SqliteStorage(const StorageOptions& options, BagFolder folder)
      : options_{options}, folder_{std::move(folder)} {
    if (options_.compression_level) {
      compressor_.emplace(*options_.compression_level);
      folder_.set_message_compression();
    }
  }

  [[nodiscard]] Result<void> create_database();
  [[nodiscard]] Result<void> write(const std::string& topic, std::string_view type,
                                   std::int64_t timestamp_ns, std::span<const std::byte> message,
                                   bool latched) override;
  [[nodiscard]] Result<void> close() override;

 private:
  struct Topic {
    std::int64_t id = 0;
    std::size_t index = 0;  ///< into the metadata's topics
  };

  [[nodiscard]] Result<Topic> add_topic(const std::string& name, std::string_view type,
                                        bool latched);
  [[nodiscard]] Result<void> store_metadata();
  [[nodiscard]] Result<void> commit_if_due(std::int64_t timestamp_ns, std::size_t bytes);
  [[nodiscard]] Result<void> named(Result<void> result) const;

  const StorageOptions options_;
  BagFolder folder_;
  std::unique_ptr<Database> database_;
  std::optional<Statement> insert_;
  std::optional<Compressor> compressor_;
  std::map<std::string, Topic, std::less<>> topics_;
  std::int64_t transaction_start_ns_ = 0;
  std::size_t transaction_bytes_ = 0;
  bool in_transaction_ = false;
};

Result<void> SqliteStorage::create_database() {
  auto database = Database::create(folder_.file());
  if (!database) {
    return tl::unexpected{std::move(database).error().in(folder_.file().native())};
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
    return tl::unexpected{std::move(stored).error().in(folder_.file().native())};
  }
  insert_ = std::move(*stored);
  return {};
}

Result<SqliteStorage::Topic> SqliteStorage::add_topic(const std::string& name,
                                                      std::string_view type, bool latched) {
  const std::size_t index = folder_.add_topic(name, type, latched);
  const TopicMetadata& topic = folder_.metadata().topics[index];
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
  const Topic entry{.id = database_->last_insert_id(), .index = index};
  topics_.emplace(name, entry);
  return entry;
}

Result<void> SqliteStorage::write(const std::string& topic, std::string_view type,
                                  std::int64_t timestamp_ns, std::span<const std::byte> message,
                                  bool latched) {
  if (!insert_) {
    return fail(ErrorCode::kInvalidArgument, "{}: is closed", folder_.file().native());
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
  folder_.count(entry->index, timestamp_ns);
  return named(commit_if_due(timestamp_ns, message.size()));
}

Result<void> SqliteStorage::commit_if_due(std::int64_t timestamp_ns, std::size_t bytes) {
  transaction_bytes_ += bytes;
  const Duration open_for{timestamp_ns - transaction_start_ns_};
  if (open_for < options_.commit_after && transaction_bytes_ < options_.commit_after_bytes) {
    return {};
  }
  in_transaction_ = false;
  return database_->execute("COMMIT");
}

Result<void> SqliteStorage::store_metadata() {
  return database_->prepare("INSERT INTO metadata (metadata_version, metadata) VALUES (?, ?)")
      .and_then([this](Statement statement) {
        const std::string yaml = to_stored_yaml(folder_.metadata());
        return statement.bind(1, std::int64_t{folder_.metadata().version})
            .bind(2, std::string_view{yaml})
            .run();
      });
}

Result<void> SqliteStorage::close() {
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
  return folder_.write_description();
}

Result<void> SqliteStorage::named(Result<void> result) const {
  if (!result) {
    return tl::unexpected{std::move(result).error().in(folder_.file().native())};
  }
  return result;
}

}  // namespace

Result<std::unique_ptr<Storage>> create_sqlite_storage(const StorageOptions& options) {
  auto folder = BagFolder::create(options.directory, "sqlite3", "db3", options.custom_data);
  if (!folder) {
    return tl::unexpected{std::move(folder).error()};
  }
  auto storage = std::make_unique<SqliteStorage>(options, *std::move(folder));
  if (auto created = storage->create_database(); !created) {
    return tl::unexpected{std::move(created).error()};
  }
  return storage;
}

Result<std::unique_ptr<Storage>> Storage::create(const StorageOptions& options) {
  return options.storage == BagStorage::kMcap ? create_mcap_storage(options)
                                              : create_sqlite_storage(options);
}

}  // namespace geoflow::drivers::bag
