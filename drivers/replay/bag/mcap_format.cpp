#include "replay/bag/mcap_format.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "fields.hpp"

namespace geoflow::drivers::bag::mcap {
namespace {

constexpr std::size_t kChunkHeadFixedBytes = 40;  // without the name of the compression

std::string take_text(FieldReader& in) {
  const auto bytes = in.take_bytes(in.take<std::uint32_t>());
  std::string text;
  text.reserve(bytes.size());
  for (const std::byte byte : bytes) {
    text.push_back(std::to_integer<char>(byte));
  }
  return text;
}

std::map<std::string, std::string> take_map(FieldReader& in) {
  FieldReader entries{in.take_bytes(in.take<std::uint32_t>())};
  std::map<std::string, std::string> values;
  while (!entries.left().empty()) {
    std::string key = take_text(entries);
    std::string value = take_text(entries);
    values.insert_or_assign(std::move(key), std::move(value));
  }
  return values;
}

void put_map(FieldWriter& out, const std::map<std::string, std::string>& values) {
  FieldWriter entries;
  for (const auto& [key, value] : values) {
    put_text(entries, key);
    put_text(entries, value);
  }
  const auto bytes = std::move(entries).take();
  out.put(static_cast<std::uint32_t>(bytes.size())).put_bytes(bytes);
}

template <typename Value>
Result<Value> whole(const FieldReader& in, Value value, const char* what) {
  if (!in.ok()) {
    return fail(ErrorCode::kInvalidData, "a {} record is too short for its fields", what);
  }
  return value;
}

FieldWriter record_head(Opcode opcode, std::uint64_t size) {
  FieldWriter out;
  out.put(static_cast<std::uint8_t>(opcode)).put(size);
  return out;
}

}  // namespace

Result<Schema> parse_schema(std::span<const std::byte> content) {
  FieldReader in{content};
  Schema schema{.id = in.take<std::uint16_t>(),
                .name = take_text(in),
                .encoding = take_text(in),
                .data = take_text(in)};
  return whole(in, std::move(schema), "schema");
}

Result<Channel> parse_channel(std::span<const std::byte> content) {
  FieldReader in{content};
  Channel channel{.id = in.take<std::uint16_t>(),
                  .schema_id = in.take<std::uint16_t>(),
                  .topic = take_text(in),
                  .message_encoding = take_text(in),
                  .metadata = take_map(in)};
  return whole(in, std::move(channel), "channel");
}

Result<MessageHead> parse_message_head(std::span<const std::byte> content) {
  FieldReader in{content};
  const MessageHead head{.channel_id = in.take<std::uint16_t>(),
                         .sequence = in.take<std::uint32_t>(),
                         .log_time_ns = in.take<std::uint64_t>(),
                         .publish_time_ns = in.take<std::uint64_t>()};
  return whole(in, head, "message");
}

Result<ChunkHead> parse_chunk_head(std::span<const std::byte> content) {
  FieldReader in{content};
  ChunkHead head{.start_ns = in.take<std::uint64_t>(),
                 .end_ns = in.take<std::uint64_t>(),
                 .content_bytes = in.take<std::uint64_t>(),
                 .content_crc = in.take<std::uint32_t>(),
                 .compression = take_text(in),
                 .stored_bytes = in.take<std::uint64_t>()};
  return whole(in, std::move(head), "chunk");
}

Result<Statistics> parse_statistics(std::span<const std::byte> content) {
  FieldReader in{content};
  Statistics statistics{.message_count = in.take<std::uint64_t>(),
                        .schema_count = in.take<std::uint16_t>(),
                        .channel_count = in.take<std::uint32_t>(),
                        .attachment_count = in.take<std::uint32_t>(),
                        .metadata_count = in.take<std::uint32_t>(),
                        .chunk_count = in.take<std::uint32_t>(),
                        .start_ns = in.take<std::uint64_t>(),
                        .end_ns = in.take<std::uint64_t>(),
                        .messages = {}};
  FieldReader entries{in.take_bytes(in.take<std::uint32_t>())};
  while (!entries.left().empty()) {
    const auto channel = entries.take<std::uint16_t>();
    statistics.messages[channel] = entries.take<std::uint64_t>();
  }
  return whole(in, std::move(statistics), "statistics");
}

Result<Metadata> parse_metadata_record(std::span<const std::byte> content) {
  FieldReader in{content};
  Metadata metadata{.name = take_text(in), .values = take_map(in)};
  return whole(in, std::move(metadata), "metadata");
}

Result<Footer> parse_footer(std::span<const std::byte> content) {
  FieldReader in{content};
  const Footer footer{.summary_start = in.take<std::uint64_t>(),
                      .summary_offsets_start = in.take<std::uint64_t>(),
                      .summary_crc = in.take<std::uint32_t>()};
  return whole(in, footer, "footer");
}

Result<Record> take_record(std::span<const std::byte>& bytes) {
  FieldReader in{bytes};
  const auto opcode = static_cast<Opcode>(in.take<std::uint8_t>());
  const auto size = in.take<std::uint64_t>();
  const auto content = in.take_bytes(size);
  if (!in.ok()) {
    return fail(ErrorCode::kInvalidData, "a record of {} bytes is longer than what is left", size);
  }
  bytes = in.left();
  return Record{.opcode = opcode, .content = content};
}

std::size_t head_bytes(const ChunkHead& head) noexcept {
  return kChunkHeadFixedBytes + head.compression.size();
}

void put_text(FieldWriter& out, std::string_view text) {
  out.put(static_cast<std::uint32_t>(text.size())).put_bytes(std::as_bytes(std::span{text}));
}

std::vector<std::byte> to_record(Opcode opcode, std::span<const std::byte> content) {
  FieldWriter out = record_head(opcode, content.size());
  out.put_bytes(content);
  return std::move(out).take();
}

std::vector<std::byte> to_record(const Schema& schema) {
  FieldWriter out;
  out.put(schema.id);
  put_text(out, schema.name);
  put_text(out, schema.encoding);
  put_text(out, schema.data);
  return to_record(Opcode::kSchema, std::move(out).take());
}

std::vector<std::byte> to_record(const Channel& channel) {
  FieldWriter out;
  out.put(channel.id).put(channel.schema_id);
  put_text(out, channel.topic);
  put_text(out, channel.message_encoding);
  put_map(out, channel.metadata);
  return to_record(Opcode::kChannel, std::move(out).take());
}

std::vector<std::byte> to_record(const Statistics& statistics) {
  constexpr std::size_t kEntryBytes = sizeof(std::uint16_t) + sizeof(std::uint64_t);
  FieldWriter out;
  out.put(statistics.message_count)
      .put(statistics.schema_count)
      .put(statistics.channel_count)
      .put(statistics.attachment_count)
      .put(statistics.metadata_count)
      .put(statistics.chunk_count)
      .put(statistics.start_ns)
      .put(statistics.end_ns)
      .put(static_cast<std::uint32_t>(statistics.messages.size() * kEntryBytes));
  for (const auto& [channel, count] : statistics.messages) {
    out.put(channel).put(count);
  }
  return to_record(Opcode::kStatistics, std::move(out).take());
}

std::vector<std::byte> to_record(const Metadata& metadata) {
  FieldWriter out;
  put_text(out, metadata.name);
  put_map(out, metadata.values);
  return to_record(Opcode::kMetadata, std::move(out).take());
}

std::vector<std::byte> begin_record(const MessageHead& head, std::uint64_t rest) {
  FieldWriter out = record_head(Opcode::kMessage, MessageHead::kBytes + rest);
  out.put(head.channel_id).put(head.sequence).put(head.log_time_ns).put(head.publish_time_ns);
  return std::move(out).take();
}

std::vector<std::byte> begin_record(const ChunkHead& head) {
  FieldWriter out = record_head(Opcode::kChunk, head_bytes(head) + head.stored_bytes);
  out.put(head.start_ns).put(head.end_ns).put(head.content_bytes).put(head.content_crc);
  put_text(out, head.compression);
  out.put(head.stored_bytes);
  return std::move(out).take();
}

}  // namespace geoflow::drivers::bag::mcap
