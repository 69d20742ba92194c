#include "replay/bag/mcap_file.hpp"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/types.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"

#include "replay/bag/bag_file.hpp"
#include "replay/bag/chunk_codec.hpp"
#include "replay/bag/mcap_format.hpp"

namespace geoflow::drivers::bag {
namespace {

using mcap::Opcode;

std::int64_t signed_ns(std::uint64_t ns) {
  return static_cast<std::int64_t>(
      std::min<std::uint64_t>(ns, std::numeric_limits<std::int64_t>::max()));
}

}  // namespace

Result<std::unique_ptr<BagFile>> McapFile::open(const std::filesystem::path& path) {
  std::unique_ptr<McapFile> file{new McapFile{path}};
  file->fd_.reset(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  std::error_code error;
  file->size_ = std::filesystem::file_size(path, error);
  if (!file->fd_ || error) {
    return fail_errno(path.native());
  }
  auto opened = file->walk().and_then(
      [&] { return file->summary_is_whole() ? Result<void>{} : file->count_messages(); });
  if (!opened) {
    return tl::unexpected{file->in_this_file(std::move(opened).error())};
  }
  return std::unique_ptr<BagFile>{std::move(file)};
}

Result<std::vector<std::byte>> McapFile::read_at(std::uint64_t offset, std::uint64_t size) const {
  std::vector<std::byte> bytes(size);
  std::span<std::byte> left{bytes};
  while (!left.empty()) {
    const ssize_t count = ::pread(fd_.get(), left.data(), left.size(),
                                  static_cast<off_t>(offset + size - left.size()));
    if (count < 0 && errno != EINTR) {
      return fail_errno("reading");
    }
    if (count == 0) {
      return fail(ErrorCode::kInvalidData, "byte {}: the file has become shorter", offset);
    }
    left = left.subspan(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  }
  return bytes;
}

Result<BagFile::Extent> McapFile::extent() {
  Extent extent;
  for (std::size_t i = 0; i < topics().size(); ++i) {
    const auto id = static_cast<std::uint16_t>(topics()[i].id);
    const bool said = statistics_ && statistics_->messages.contains(id);
    extent.counts.push_back(said ? statistics_->messages.at(id) : counts_[i]);
  }
  const std::uint64_t messages =
      std::accumulate(extent.counts.begin(), extent.counts.end(), std::uint64_t{0});
  if (messages > 0 && !blocks_.empty()) {
    const auto start = [](const Block& block) { return block.head.start_ns; };
    const auto end = [](const Block& block) { return block.head.end_ns; };
    extent.start_ns = signed_ns(start(*std::ranges::min_element(blocks_, {}, start)));
    extent.end_ns = signed_ns(end(*std::ranges::max_element(blocks_, {}, end)));
  }
  return extent;
}

Result<std::optional<std::int64_t>> McapFile::start_ns() {
  if (blocks_.empty()) {
    return std::nullopt;
  }
  return extent().map([](const Extent& extent) { return std::optional{extent.start_ns}; });
}

std::optional<std::string> McapFile::stored_metadata() {
  return stored_metadata_;
}

Result<void> McapFile::select(const std::function<bool(const FileTopic&)>& wanted) {
  wanted_ = wanted;
  waiting_.assign(blocks_.begin(), blocks_.end());
  std::ranges::stable_sort(waiting_, {}, [](const Block& block) { return block.head.start_ns; });
  open_.clear();
  current_ = {};
  number_ = 0;
  told_of_cut_ = false;
  return {};
}

Result<std::vector<std::byte>> McapFile::load(const Block& block) const {
  const mcap::ChunkHead& head = block.head;
  if (head.stored_bytes > kMaxChunkBytes) {
    return fail(ErrorCode::kUnsupported, "chunk at byte {}: {} bytes are more than the limit of {}",
                block.offset, head.stored_bytes, kMaxChunkBytes);
  }
  auto content = read_at(block.records, head.stored_bytes).and_then([&](const auto& stored) {
    return unpack_chunk(head.compression, stored, head.content_bytes, head.content_crc);
  });
  if (!content) {
    return tl::unexpected{
        std::move(content).error().in(fmt::format("chunk at byte {}", block.offset))};
  }
  return content;
}

bool McapFile::has_wanted(const Block& block) const {
  return block.channels.empty() || std::ranges::any_of(block.channels, [this](std::uint16_t id) {
           const auto topic = index_of(id);
           return topic && wanted_(topics()[*topic]);
         });
}

Result<McapFile::OpenBlock> McapFile::open_block(const Block& block) const {
  auto loaded = load(block);
  if (!loaded) {
    return tl::unexpected{std::move(loaded).error()};
  }
  OpenBlock made{.content = std::make_shared<const std::vector<std::byte>>(*std::move(loaded)),
                 .entries = {}};
  std::vector<bool> wanted;
  std::ranges::transform(topics(), std::back_inserter(wanted), wanted_);
  std::span<const std::byte> left{*made.content};
  while (!left.empty()) {
    const auto record = mcap::take_record(left);
    const auto head = record && record->opcode == Opcode::kMessage
                          ? mcap::parse_message_head(record->content)
                          : Result<mcap::MessageHead>{};
    if (!record || !head) {
      Error error = record ? head.error() : record.error();
      return tl::unexpected{std::move(error).in(fmt::format("chunk at byte {}", block.offset))};
    }
    const auto topic =
        record->opcode == Opcode::kMessage ? index_of(head->channel_id) : std::nullopt;
    if (topic && wanted[*topic]) {
      made.entries.push_back({.timestamp_ns = signed_ns(head->log_time_ns),
                              .topic = *topic,
                              .message = record->content.subspan(mcap::MessageHead::kBytes)});
    }
  }
  std::ranges::stable_sort(made.entries, {}, &Entry::timestamp_ns);
  return made;
}

std::vector<McapFile::OpenBlock>::iterator McapFile::earliest() {
  return std::ranges::min_element(
      open_, {}, [](const OpenBlock& block) { return block.entries.front().timestamp_ns; });
}

Result<void> McapFile::open_due_blocks() {
  const auto due = [this] {
    return !waiting_.empty() && (open_.empty() || signed_ns(waiting_.front().head.start_ns) <=
                                                      earliest()->entries.front().timestamp_ns);
  };
  while (due()) {
    const Block block = std::move(waiting_.front());
    waiting_.pop_front();
    if (!has_wanted(block)) {
      continue;
    }
    const std::uint64_t held = std::accumulate(
        open_.begin(), open_.end(), std::uint64_t{0},
        [](std::uint64_t sum, const OpenBlock& one) { return sum + one.content->size(); });
    if (held + block.head.content_bytes > kMaxOpenBytes) {
      waiting_.clear();
      return fail(ErrorCode::kUnsupported,
                  "chunk at byte {}: chunks that overlap in time have more than {} bytes",
                  block.offset, kMaxOpenBytes);
    }
    auto made = open_block(block);
    if (!made) {
      return tl::unexpected{std::move(made).error()};
    }
    if (!made->entries.empty()) {
      open_.push_back(*std::move(made));
    }
  }
  return {};
}

Result<std::optional<MessageRow>> McapFile::next() {
  current_ = {};
  if (auto opened = open_due_blocks(); !opened) {
    return tl::unexpected{in_this_file(std::move(opened).error())};
  }
  if (open_.empty()) {
    if (cut_off_at_ && !std::exchange(told_of_cut_, true)) {
      return fail(ErrorCode::kInvalidData,
                  "{}: is cut off: its last whole record ends at byte {} of {}", path().native(),
                  *cut_off_at_, size_);
    }
    return std::nullopt;
  }
  const auto first = earliest();
  current_ = {.content = first->content, .entries = {first->entries.front()}};
  first->entries.pop_front();
  if (first->entries.empty()) {
    open_.erase(first);
  }
  const Entry& entry = current_.entries.front();
  return MessageRow{.number = ++number_, .timestamp_ns = entry.timestamp_ns, .topic = entry.topic};
}

Result<std::span<const std::byte>> McapFile::data(const MessageRow& row) {
  if (current_.entries.empty() || row.number != number_) {
    return fail(ErrorCode::kInvalidArgument, "{}: is not the message that was read last",
                describe(row));
  }
  return current_.entries.front().message;
}

}  // namespace geoflow::drivers::bag
