#include "replay/bag/bag_file.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "geoflow/hal/result.hpp"

#include "replay/bag/mcap_file.hpp"
#include "replay/bag/mcap_format.hpp"
#include "replay/bag/sqlite_file.hpp"

namespace geoflow::drivers::bag {

Result<std::unique_ptr<BagFile>> BagFile::open(const std::filesystem::path& path) {
  std::string head(mcap::kMagic.size(), '\0');
  std::ifstream file{path, std::ios::binary};
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  return head == mcap::kMagic ? McapFile::open(path) : SqliteFile::open(path);
}

std::string BagFile::describe(const MessageRow& row) const {
  return fmt::format("{}: message {} ({})", path_.native(), row.number, topics_[row.topic].name);
}

std::optional<std::size_t> BagFile::index_of(std::int64_t topic_id) const {
  const auto found = std::ranges::find(topics_, topic_id, &FileTopic::id);
  if (found == topics_.end()) {
    return std::nullopt;
  }
  return static_cast<std::size_t>(found - topics_.begin());
}

Error BagFile::in_this_file(Error error) const {
  return std::move(error).in(path_.native());
}

}  // namespace geoflow::drivers::bag
