#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "replay/bag/bag_file.hpp"
#include "replay/bag/mcap_format.hpp"

namespace geoflow::drivers::bag {

/// One .mcap file. It is walked through once, from record to record, without its chunks' content:
/// so it needs no summary, and one that was cut off gives what is whole and then an error. Of its
/// chunks those are in memory that overlap in time with the newest message. Thread-bound.
class McapFile final : public BagFile {
 public:
  /// Beyond this many bytes of chunks that overlap in time the file is given up.
  static constexpr std::uint64_t kMaxOpenBytes = std::uint64_t{1} << 30U;

  [[nodiscard]] static Result<std::unique_ptr<BagFile>> open(const std::filesystem::path& path);

  [[nodiscard]] Result<Extent> extent() override;
  [[nodiscard]] Result<std::optional<std::int64_t>> start_ns() override;
  /// rosbag2's copy, a metadata record of its own.
  [[nodiscard]] std::optional<std::string> stored_metadata() override;
  /// `wanted` is asked again for every chunk: those without a wanted message are not read.
  [[nodiscard]] Result<void> select(const std::function<bool(const FileTopic&)>& wanted) override;
  [[nodiscard]] Result<std::optional<MessageRow>> next() override;
  [[nodiscard]] Result<std::span<const std::byte>> data(const MessageRow& row) override;

 private:
  /// A chunk, or messages that stand one after another in none.
  struct Block {
    std::uint64_t offset = 0;   ///< of the record's first byte
    std::uint64_t records = 0;  ///< offset of what is stored
    mcap::ChunkHead head;
    std::vector<std::uint16_t> channels{};  ///< that it has messages of; empty: not said
  };
  struct Entry {
    std::int64_t timestamp_ns = 0;
    std::size_t topic = 0;
    std::span<const std::byte> message;
  };
  struct OpenBlock {
    std::shared_ptr<const std::vector<std::byte>> content;
    std::deque<Entry> entries;  ///< by time
  };

  explicit McapFile(std::filesystem::path path) : BagFile{std::move(path)} {}
  [[nodiscard]] Result<void> walk();
  [[nodiscard]] Result<void> take(mcap::Opcode opcode, std::uint64_t at, std::uint64_t size);
  [[nodiscard]] Result<void> take_content(const mcap::Record& record);
  [[nodiscard]] Result<void> add_chunk(std::uint64_t at, std::uint64_t size);
  [[nodiscard]] Result<void> add_index(std::uint64_t at, std::uint64_t size);
  [[nodiscard]] Result<void> add_message(std::uint64_t at, std::uint64_t size);
  void add_channel(const mcap::Channel& channel);
  [[nodiscard]] bool summary_is_whole() const;
  [[nodiscard]] Result<void> count_messages();
  [[nodiscard]] Result<std::vector<std::byte>> read_at(std::uint64_t offset,
                                                       std::uint64_t size) const;
  [[nodiscard]] Result<std::vector<std::byte>> load(const Block& block) const;
  [[nodiscard]] bool has_wanted(const Block& block) const;
  [[nodiscard]] Result<OpenBlock> open_block(const Block& block) const;
  [[nodiscard]] Result<void> open_due_blocks();
  [[nodiscard]] std::vector<OpenBlock>::iterator earliest();

  UniqueFd fd_;
  std::uint64_t size_ = 0;
  std::optional<std::uint64_t> cut_off_at_;  ///< the first byte that belongs to no whole record
  std::map<std::uint16_t, std::string> schemas_;
  std::vector<Block> blocks_;
  std::optional<mcap::Statistics> statistics_;
  std::map<std::size_t, std::uint64_t> counts_;  ///< by topic
  std::optional<std::string> stored_metadata_;

  std::function<bool(const FileTopic&)> wanted_;
  std::deque<Block> waiting_;
  std::vector<OpenBlock> open_;
  OpenBlock current_;  ///< keeps what next() returned last, its only entry
  std::int64_t number_ = 0;
  bool told_of_cut_ = false;
};

}  // namespace geoflow::drivers::bag
