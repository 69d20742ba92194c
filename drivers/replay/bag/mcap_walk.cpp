#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "fields.hpp"
#include "replay/bag/bag_file.hpp"
#include "replay/bag/mcap_file.hpp"
#include "replay/bag/mcap_format.hpp"

// What McapFile finds when it is opened.
namespace geoflow::drivers::bag {
namespace {

using mcap::Opcode;

constexpr std::uint64_t kMaxRecordBytes = std::uint64_t{16} << 20U;  // of all but chunks, messages
constexpr std::uint64_t kChunkHeadBytes = 64;  // more than its fields and a compression's name need
constexpr std::uint64_t kRunBytes = std::uint64_t{4} << 20U;  // of messages outside of chunks

}  // namespace

Result<void> McapFile::walk() {
  std::uint64_t at = mcap::kMagic.size();
  while (size_ - at >= mcap::kRecordHeadBytes) {
    const auto head = read_at(at, mcap::kRecordHeadBytes);
    if (!head) {
      return tl::unexpected{head.error()};
    }
    FieldReader in{*head};
    const auto opcode = static_cast<Opcode>(in.take<std::uint8_t>());
    const auto size = in.take<std::uint64_t>();
    if (opcode == Opcode{}) {
      return fail(ErrorCode::kInvalidData, "byte {}: no record begins with a zero", at);
    }
    if (size > size_ - at - mcap::kRecordHeadBytes) {
      break;
    }
    if (auto taken = take(opcode, at, size); !taken) {
      return tl::unexpected{std::move(taken).error().in(fmt::format("byte {}", at))};
    }
    if (opcode == Opcode::kFooter) {
      return {};
    }
    at += mcap::kRecordHeadBytes + size;
  }
  cut_off_at_ = at;
  return {};
}

Result<void> McapFile::take(Opcode opcode, std::uint64_t at, std::uint64_t size) {
  switch (opcode) {
    case Opcode::kChunk:
      return add_chunk(at, size);
    case Opcode::kMessage:
      return add_message(at, size);
    case Opcode::kMessageIndex:
      return add_index(at, size);
    case Opcode::kSchema:
    case Opcode::kChannel:
    case Opcode::kMetadata:
    case Opcode::kStatistics:
      break;
    default:
      return {};
  }
  if (size > kMaxRecordBytes) {
    return fail(ErrorCode::kInvalidData, "a record of {} bytes is too long for its kind", size);
  }
  return read_at(at + mcap::kRecordHeadBytes, size).and_then([&](const auto& content) {
    return take_content({.opcode = opcode, .content = content});
  });
}

Result<void> McapFile::take_content(const mcap::Record& record) {
  switch (record.opcode) {
    case Opcode::kSchema:
      return mcap::parse_schema(record.content).map([this](mcap::Schema schema) {
        schemas_.insert_or_assign(schema.id, std::move(schema.name));
      });
    case Opcode::kChannel:
      return mcap::parse_channel(record.content).map([this](const mcap::Channel& channel) {
        add_channel(channel);
      });
    case Opcode::kStatistics:
      return mcap::parse_statistics(record.content).map([this](mcap::Statistics statistics) {
        statistics_ = std::move(statistics);
      });
    default:
      break;
  }
  return mcap::parse_metadata_record(record.content).map([this](const mcap::Metadata& metadata) {
    const auto copy = metadata.values.find("serialized_metadata");
    if (metadata.name == "rosbag2" && copy != metadata.values.end()) {
      stored_metadata_ = copy->second;
    }
  });
}

void McapFile::add_channel(const mcap::Channel& channel) {
  if (index_of(channel.id)) {
    return;  // said again
  }
  const auto schema = schemas_.find(channel.schema_id);
  add_topic({.id = channel.id,
             .name = channel.topic,
             .type = schema == schemas_.end() ? std::string{} : schema->second,
             .serialization_format = channel.message_encoding});
}

Result<void> McapFile::add_chunk(std::uint64_t at, std::uint64_t size) {
  const std::uint64_t begin = at + mcap::kRecordHeadBytes;
  return read_at(begin, std::min(size, kChunkHeadBytes))
      .and_then([](const auto& bytes) { return mcap::parse_chunk_head(bytes); })
      .and_then([&](mcap::ChunkHead head) -> Result<void> {
        const std::uint64_t records = mcap::head_bytes(head);
        if (records > size || head.stored_bytes > size - records) {
          return fail(ErrorCode::kInvalidData, "a chunk's records are longer than the chunk");
        }
        blocks_.push_back({.offset = at, .records = begin + records, .head = std::move(head)});
        return {};
      });
}

Result<void> McapFile::add_index(std::uint64_t at, std::uint64_t size) {
  return read_at(at + mcap::kRecordHeadBytes, std::min<std::uint64_t>(size, sizeof(std::uint16_t)))
      .map([this](const auto& bytes) {
        if (!blocks_.empty()) {
          blocks_.back().channels.push_back(FieldReader{bytes}.template take<std::uint16_t>());
        }
      });
}

Result<void> McapFile::add_message(std::uint64_t at, std::uint64_t size) {
  return read_at(at + mcap::kRecordHeadBytes,
                 std::min<std::uint64_t>(size, mcap::MessageHead::kBytes))
      .and_then([](const auto& bytes) { return mcap::parse_message_head(bytes); })
      .map([&](const mcap::MessageHead& message) {
        const std::uint64_t bytes = mcap::kRecordHeadBytes + size;
        const bool goes_on = !blocks_.empty() && blocks_.back().offset == blocks_.back().records &&
                             blocks_.back().records + blocks_.back().head.stored_bytes == at &&
                             blocks_.back().head.stored_bytes < kRunBytes;
        if (!goes_on) {
          blocks_.push_back({.offset = at,
                             .records = at,
                             .head = {.start_ns = message.log_time_ns,
                                      .end_ns = message.log_time_ns,
                                      .compression = {}}});
        }
        mcap::ChunkHead& run = blocks_.back().head;
        run.start_ns = std::min(run.start_ns, message.log_time_ns);
        run.end_ns = std::max(run.end_ns, message.log_time_ns);
        run.stored_bytes += bytes;
        run.content_bytes += bytes;
      });
}

bool McapFile::summary_is_whole() const {
  if (!statistics_ || cut_off_at_) {
    return false;
  }
  std::uint64_t messages = 0;
  for (const auto& [channel, count] : statistics_->messages) {
    if (!index_of(channel)) {
      return false;
    }
    messages += count;
  }
  return messages == statistics_->message_count;
}

Result<void> McapFile::count_messages() {
  statistics_.reset();
  for (const Block& block : blocks_) {
    const auto content = load(block);
    if (!content) {
      continue;  // it is told when it is read
    }
    std::span<const std::byte> left{*content};
    while (!left.empty()) {
      const auto record = mcap::take_record(left);
      if (!record) {
        break;
      }
      if (record->opcode == Opcode::kSchema || record->opcode == Opcode::kChannel) {
        if (auto taken = take_content(*record); !taken) {
          break;
        }
      } else if (record->opcode == Opcode::kMessage) {
        const auto head = mcap::parse_message_head(record->content);
        const auto topic = head ? index_of(head->channel_id) : std::nullopt;
        if (topic) {
          ++counts_[*topic];
        }
      }
    }
  }
  return {};
}

}  // namespace geoflow::drivers::bag
