#include <algorithm>
#include <cerrno>
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

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/types.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "fields.hpp"
#include "replay/bag/bag_folder.hpp"
#include "replay/bag/chunk_codec.hpp"
#include "replay/bag/mcap_format.hpp"
#include "replay/bag/message_definitions.hpp"
#include "replay/bag/metadata.hpp"
#include "replay/bag/storage.hpp"
#include "replay/bag/zstd_codec.hpp"

namespace geoflow::drivers::bag {
namespace {

using Bytes = std::vector<std::byte>;
using mcap::Opcode;

/// Larger chunks would not compress better, and readers hold whole ones.
constexpr std::size_t kMostChunkBytes = std::size_t{4} << 20U;

void append(Bytes& to, std::span<const std::byte> bytes) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// A file that only grows.
class GrowingFile {
 public:
  [[nodiscard]] Result<void> create(const std::string& path) {
    constexpr mode_t kMode = 0644;
    fd_.reset(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kMode));
    return fd_ ? Result<void>{} : fail_errno(path);
  }
  [[nodiscard]] bool is_open() const noexcept { return static_cast<bool>(fd_); }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }

  [[nodiscard]] Result<void> write(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t count = ::write(fd_.get(), bytes.data(), bytes.size());
      if (count < 0 && errno != EINTR) {
        return fail_errno("writing");
      }
      const auto written = static_cast<std::size_t>(std::max<ssize_t>(count, 0));
      size_ += written;
      bytes = bytes.subspan(written);
    }
    return {};
  }
  [[nodiscard]] Result<void> sync() const {
    return ::fdatasync(fd_.get()) == 0 ? Result<void>{} : fail_errno("fdatasync");
  }
  void close() { fd_.reset(); }

 private:
  UniqueFd fd_;
  std::uint64_t size_ = 0;
};

/// The chunk that is being filled, and where its messages are.
struct OpenChunk {
  Bytes records;
  std::uint64_t start_ns = 0;
  std::uint64_t end_ns = 0;
  std::map<std::uint16_t, FieldWriter> index;  ///< time and offset of each message, by channel
  std::map<std::uint16_t, std::uint32_t> counts;
};

class McapStorage final : public Storage {
 public:
  McapStorage(const StorageOptions& options, BagFolder folder)
      : options_{options}, folder_{std::move(folder)} {
    if (options_.compression_level) {
      compressor_.emplace(*options_.compression_level);
    }
  }

  [[nodiscard]] Result<void> begin();
  [[nodiscard]] Result<void> write(const std::string& topic, std::string_view type,
                                   std::int64_t timestamp_ns, std::span<const std::byte> message,
                                   bool latched) override;
  [[nodiscard]] Result<void> close() override;

 private:
  /// A part of the summary, as its offsets have it.
  struct Group {
    Opcode opcode{};
    std::uint64_t start = 0;
    std::uint64_t size = 0;
  };

  [[nodiscard]] std::uint16_t channel_of(const std::string& topic, std::string_view type,
                                         bool latched);
  [[nodiscard]] std::uint16_t schema_of(std::string_view type);
  [[nodiscard]] Result<void> end_chunk();
  [[nodiscard]] Result<void> write_metadata();
  [[nodiscard]] Bytes summary() const;
  [[nodiscard]] mcap::Statistics statistics() const;
  [[nodiscard]] Result<void> named(Result<void> result) const;

  const StorageOptions options_;
  BagFolder folder_;
  GrowingFile file_;
  std::optional<Compressor> compressor_;
  std::map<std::string, std::uint16_t, std::less<>> schemas_;
  std::map<std::string, std::uint16_t, std::less<>> channels_;  ///< index in the metadata + 1
  std::map<std::uint16_t, std::uint64_t> counts_;
  Bytes schema_records_;
  Bytes channel_records_;
  Bytes chunk_index_records_;
  Bytes metadata_index_records_;
  std::uint32_t chunks_ = 0;
  std::uint32_t metadata_records_ = 0;
  OpenChunk chunk_;
  std::uint64_t synced_ns_ = 0;
};

Result<void> McapStorage::begin() {
  FieldWriter header;
  mcap::put_text(header, "ros2");
  mcap::put_text(header, "geoflow");
  return file_.create(folder_.file().native())
      .and_then([&] { return file_.write(std::as_bytes(std::span{mcap::kMagic})); })
      .and_then(
          [&] { return file_.write(mcap::to_record(Opcode::kHeader, std::move(header).take())); })
      .and_then([&] { return write_metadata(); });
}

std::uint16_t McapStorage::schema_of(std::string_view type) {
  if (const auto known = schemas_.find(type); known != schemas_.end()) {
    return known->second;
  }
  const auto id = static_cast<std::uint16_t>(schemas_.size() + 1);
  schemas_.emplace(type, id);
  const Bytes record = mcap::to_record(mcap::Schema{.id = id,
                                                    .name = std::string{type},
                                                    .encoding = "ros2msg",
                                                    .data = message_definition(type)});
  append(schema_records_, record);
  append(chunk_.records, record);
  return id;
}

std::uint16_t McapStorage::channel_of(const std::string& topic, std::string_view type,
                                      bool latched) {
  if (const auto known = channels_.find(topic); known != channels_.end()) {
    return known->second;
  }
  const std::uint16_t schema = schema_of(type);
  const std::size_t index = folder_.add_topic(topic, type, latched);
  const TopicMetadata& about = folder_.metadata().topics[index];
  const auto id = static_cast<std::uint16_t>(index + 1);
  channels_.emplace(topic, id);
  const Bytes record = mcap::to_record(
      mcap::Channel{.id = id,
                    .schema_id = schema,
                    .topic = topic,
                    .message_encoding = about.serialization_format,
                    .metadata = {{"offered_qos_profiles", about.offered_qos_profiles}}});
  append(channel_records_, record);
  append(chunk_.records, record);
  return id;
}

Result<void> McapStorage::write(const std::string& topic, std::string_view type,
                                std::int64_t timestamp_ns, std::span<const std::byte> message,
                                bool latched) {
  if (!file_.is_open()) {
    return fail(ErrorCode::kInvalidArgument, "{}: is closed", folder_.file().native());
  }
  const auto time_ns = static_cast<std::uint64_t>(timestamp_ns);
  const bool first = chunk_.counts.empty();
  const std::uint16_t channel = channel_of(topic, type, latched);
  chunk_.start_ns = first ? time_ns : std::min(chunk_.start_ns, time_ns);
  chunk_.end_ns = first ? time_ns : std::max(chunk_.end_ns, time_ns);
  chunk_.index[channel].put(time_ns).put(static_cast<std::uint64_t>(chunk_.records.size()));
  ++chunk_.counts[channel];
  append(chunk_.records,
         mcap::begin_record({.channel_id = channel,
                             .sequence = static_cast<std::uint32_t>(counts_[channel]),
                             .log_time_ns = time_ns,
                             .publish_time_ns = time_ns},
                            message.size()));
  append(chunk_.records, message);
  ++counts_[channel];
  folder_.count(channel - 1U, timestamp_ns);
  const Duration open_for{static_cast<std::int64_t>(time_ns - chunk_.start_ns)};
  if (open_for < options_.commit_after &&
      chunk_.records.size() < std::min(options_.commit_after_bytes, kMostChunkBytes)) {
    return {};
  }
  return named(end_chunk());
}

Result<void> McapStorage::end_chunk() {
  if (chunk_.counts.empty()) {
    return {};
  }
  OpenChunk chunk = std::exchange(chunk_, {});
  mcap::ChunkHead head{.start_ns = chunk.start_ns,
                       .end_ns = chunk.end_ns,
                       .content_bytes = chunk.records.size(),
                       .content_crc = crc32_of(chunk.records),
                       .compression = compressor_ ? "zstd" : ""};
  if (compressor_) {
    auto compressed = compressor_->compress(chunk.records);
    if (!compressed) {
      return tl::unexpected{std::move(compressed).error()};
    }
    chunk.records = *std::move(compressed);
  }
  head.stored_bytes = chunk.records.size();
  const std::uint64_t start = file_.size();
  Result<void> done =
      file_.write(mcap::begin_record(head)).and_then([&] { return file_.write(chunk.records); });
  const std::uint64_t chunk_bytes = file_.size() - start;
  FieldWriter offsets;
  const std::uint64_t indices_start = file_.size();
  for (auto& [channel, entries] : chunk.index) {
    offsets.put(channel).put(file_.size());
    const Bytes list = std::move(entries).take();
    FieldWriter index;
    index.put(channel).put(static_cast<std::uint32_t>(list.size())).put_bytes(list);
    const Bytes record = mcap::to_record(Opcode::kMessageIndex, std::move(index).take());
    done = done.and_then([&] { return file_.write(record); });
  }
  const Bytes offset_list = std::move(offsets).take();
  FieldWriter index;
  index.put(head.start_ns).put(head.end_ns).put(start).put(chunk_bytes);
  index.put(static_cast<std::uint32_t>(offset_list.size())).put_bytes(offset_list);
  index.put(file_.size() - indices_start);
  mcap::put_text(index, head.compression);
  index.put(head.stored_bytes).put(head.content_bytes);
  append(chunk_index_records_, mcap::to_record(Opcode::kChunkIndex, std::move(index).take()));
  ++chunks_;
  if (head.end_ns - std::min(head.end_ns, synced_ns_) >=
      static_cast<std::uint64_t>(options_.commit_after.count())) {
    synced_ns_ = head.end_ns;
    done = done.and_then([&] { return file_.sync(); });
  }
  return done;
}

Result<void> McapStorage::write_metadata() {
  const std::uint64_t start = file_.size();
  constexpr const char* kName = "rosbag2";
  const Bytes record = mcap::to_record(mcap::Metadata{
      .name = kName, .values = {{"serialized_metadata", to_stored_yaml(folder_.metadata())}}});
  FieldWriter index;
  index.put(start).put(static_cast<std::uint64_t>(record.size()));
  mcap::put_text(index, kName);
  append(metadata_index_records_, mcap::to_record(Opcode::kMetadataIndex, std::move(index).take()));
  ++metadata_records_;
  return file_.write(record);
}

mcap::Statistics McapStorage::statistics() const {
  const Metadata& metadata = folder_.metadata();
  return {.message_count = metadata.message_count,
          .schema_count = static_cast<std::uint16_t>(schemas_.size()),
          .channel_count = static_cast<std::uint32_t>(channels_.size()),
          .metadata_count = metadata_records_,
          .chunk_count = chunks_,
          .start_ns = static_cast<std::uint64_t>(metadata.start_ns),
          .end_ns = static_cast<std::uint64_t>(metadata.start_ns + metadata.duration_ns),
          .messages = counts_};
}

/// The summary, its offsets and the footer, to stand at the end of the file as it is now.
Bytes McapStorage::summary() const {
  const std::uint64_t start = file_.size();
  Bytes bytes;
  std::vector<Group> groups;
  const auto add = [&](Opcode opcode, const Bytes& records) {
    if (!records.empty()) {
      groups.push_back({.opcode = opcode, .start = start + bytes.size(), .size = records.size()});
      append(bytes, records);
    }
  };
  add(Opcode::kSchema, schema_records_);
  add(Opcode::kChannel, channel_records_);
  add(Opcode::kStatistics, mcap::to_record(statistics()));
  add(Opcode::kChunkIndex, chunk_index_records_);
  add(Opcode::kMetadataIndex, metadata_index_records_);
  const std::uint64_t offsets_start = start + bytes.size();
  for (const Group& group : groups) {
    FieldWriter offset;
    offset.put(static_cast<std::uint8_t>(group.opcode)).put(group.start).put(group.size);
    append(bytes, mcap::to_record(Opcode::kSummaryOffset, std::move(offset).take()));
  }
  FieldWriter footer;
  footer.put(static_cast<std::uint8_t>(Opcode::kFooter))
      .put(static_cast<std::uint64_t>(mcap::Footer::kBytes))
      .put(start)
      .put(offsets_start);
  append(bytes, std::move(footer).take());
  FieldWriter crc;
  crc.put(crc32_of(bytes));
  append(bytes, std::move(crc).take());
  return bytes;
}

Result<void> McapStorage::close() {
  FieldWriter no_crc;  // every chunk has its own
  no_crc.put(std::uint32_t{0});
  Result<void> done =
      end_chunk()
          .and_then([&] { return write_metadata(); })
          .and_then([&] {
            return file_.write(mcap::to_record(Opcode::kDataEnd, std::move(no_crc).take()));
          })
          .and_then([&] { return file_.write(summary()); })
          .and_then([&] { return file_.write(std::as_bytes(std::span{mcap::kMagic})); })
          .and_then([&] { return file_.sync(); });
  file_.close();
  return done ? folder_.write_description() : named(std::move(done));
}

Result<void> McapStorage::named(Result<void> result) const {
  if (!result) {
    return tl::unexpected{std::move(result).error().in(folder_.file().native())};
  }
  return result;
}

}  // namespace

Result<std::unique_ptr<Storage>> create_mcap_storage(const StorageOptions& options) {
  auto folder = BagFolder::create(options.directory, "mcap", "mcap", options.custom_data);
  if (!folder) {
    return tl::unexpected{std::move(folder).error()};
  }
  auto storage = std::make_unique<McapStorage>(options, *std::move(folder));
  if (auto begun = storage->begin(); !begun) {
    return tl::unexpected{std::move(begun).error()};
  }
  return storage;
}

}  // namespace geoflow::drivers::bag
