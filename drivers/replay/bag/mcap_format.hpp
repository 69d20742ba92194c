#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "fields.hpp"

/// MCAP, the container of ROS 2's other storage: a magic, records (opcode, length, content) and the
/// magic again. Source: mcap.dev/spec, version 0.
namespace geoflow::drivers::bag::mcap {

inline constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};
/// Opcode and length, before each record's content.
inline constexpr std::size_t kRecordHeadBytes = 9;

enum class Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0b,
  kMetadata = 0x0c,
  kMetadataIndex = 0x0d,
  kSummaryOffset = 0x0e,
  kDataEnd = 0x0f,
};

struct Schema {
  std::uint16_t id = 0;  ///< not 0, which stands for none
  std::string name;
  std::string encoding;
  std::string data;
};

struct Channel {
  std::uint16_t id = 0;
  std::uint16_t schema_id = 0;
  std::string topic;
  std::string message_encoding;
  std::map<std::string, std::string> metadata;
};

/// Without the message itself, which follows.
struct MessageHead {
  static constexpr std::size_t kBytes = 22;
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;
  std::uint64_t publish_time_ns = 0;
};

/// Without the records, which follow.
struct ChunkHead {
  std::uint64_t start_ns = 0;
  std::uint64_t end_ns = 0;
  std::uint64_t content_bytes = 0;  ///< decompressed
  std::uint32_t content_crc = 0;    ///< 0: not given
  std::string compression;          ///< empty, `zstd` or `lz4`
  std::uint64_t stored_bytes = 0;   ///< that follow
};

struct Statistics {
  std::uint64_t message_count = 0;
  std::uint16_t schema_count = 0;
  std::uint32_t channel_count = 0;
  std::uint32_t attachment_count = 0;
  std::uint32_t metadata_count = 0;
  std::uint32_t chunk_count = 0;
  std::uint64_t start_ns = 0;
  std::uint64_t end_ns = 0;
  std::map<std::uint16_t, std::uint64_t> messages;  ///< by channel
};

struct Metadata {
  std::string name;
  std::map<std::string, std::string> values;
};

struct Footer {
  static constexpr std::size_t kBytes = 20;
  std::uint64_t summary_start = 0;  ///< 0: no summary
  std::uint64_t summary_offsets_start = 0;
  std::uint32_t summary_crc = 0;  ///< of the summary and of the footer up to here; 0: not given
};

/// From a record's content, which may be longer: fields are only ever appended. kInvalidData where
/// it is too short. Pure.
[[nodiscard]] Result<Schema> parse_schema(std::span<const std::byte> content);
[[nodiscard]] Result<Channel> parse_channel(std::span<const std::byte> content);
[[nodiscard]] Result<MessageHead> parse_message_head(std::span<const std::byte> content);
[[nodiscard]] Result<ChunkHead> parse_chunk_head(std::span<const std::byte> content);
[[nodiscard]] Result<Statistics> parse_statistics(std::span<const std::byte> content);
[[nodiscard]] Result<Metadata> parse_metadata_record(std::span<const std::byte> content);
[[nodiscard]] Result<Footer> parse_footer(std::span<const std::byte> content);

/// One record among others.
struct Record {
  Opcode opcode{};
  std::span<const std::byte> content;
};
/// The record at the beginning of `bytes`, which moves behind it. kInvalidData where it is longer
/// than what is left. Pure.
[[nodiscard]] Result<Record> take_record(std::span<const std::byte>& bytes);

/// Where the records of a chunk begin in its content. Pure.
[[nodiscard]] std::size_t head_bytes(const ChunkHead& head) noexcept;

/// Whole records. Pure.
[[nodiscard]] std::vector<std::byte> to_record(Opcode opcode, std::span<const std::byte> content);
[[nodiscard]] std::vector<std::byte> to_record(const Schema& schema);
[[nodiscard]] std::vector<std::byte> to_record(const Channel& channel);
[[nodiscard]] std::vector<std::byte> to_record(const Statistics& statistics);
[[nodiscard]] std::vector<std::byte> to_record(const Metadata& metadata);
/// The head of a record whose content, `head` and what follows, has `rest` bytes behind `head`.
[[nodiscard]] std::vector<std::byte> begin_record(const MessageHead& head, std::uint64_t rest);
[[nodiscard]] std::vector<std::byte> begin_record(const ChunkHead& head);

void put_text(FieldWriter& out, std::string_view text);

}  // namespace geoflow::drivers::bag::mcap
