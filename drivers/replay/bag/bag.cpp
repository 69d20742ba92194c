#include "replay/bag/bag.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <ios>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "replay/bag/bag_file.hpp"
#include "replay/bag/metadata.hpp"

namespace geoflow::drivers::bag {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMetadataName = "metadata.yaml";

// Times outside of [1970, 2100) are damage; inside, differences cannot overflow.
constexpr std::int64_t kEndOfTimeNs = 4'102'444'800'000'000'000;

bool is_bag_file_name(const fs::path& path) {
  const std::string name = path.filename().native();
  return name.ends_with(".db3") || name.ends_with(".db3.zstd") || name.ends_with(".mcap");
}

std::vector<fs::path> bag_files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (auto entry = fs::directory_iterator{folder, error};
       !error && entry != fs::directory_iterator{}; entry.increment(error)) {
    if (is_bag_file_name(entry->path())) {
      files.push_back(entry->path());
    }
  }
  std::ranges::sort(files);
  return files;
}

Result<std::string> read_small_file(const fs::path& path) {
  constexpr std::uintmax_t kMaxBytes = 16U << 20U;
  std::error_code error;
  const auto size = fs::file_size(path, error);
  if (error) {
    return fail(ErrorCode::kNotFound, "{}: {}", path.native(), error.message());
  }
  if (size > kMaxBytes) {
    return fail(ErrorCode::kInvalidData, "{}: {} bytes are too many for a bag's description",
                path.native(), size);
  }
  std::ifstream file{path, std::ios::binary};
  return std::string{std::istreambuf_iterator<char>{file}, {}};
}

/// Where a path of metadata.yaml leads; early versions wrote it with the bag's own folder in front.
fs::path resolve(const fs::path& folder, const std::string& relative) {
  std::error_code ignored;
  const fs::path stated = folder / relative;
  return fs::exists(stated, ignored) ? stated : folder / fs::path{relative}.filename();
}

bool is_time(std::int64_t ns) {
  return ns >= 0 && ns < kEndOfTimeNs;
}

}  // namespace

bool Bag::looks_like_one(const fs::path& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) {
    return is_bag_file_name(path);
  }
  return fs::exists(path / kMetadataName, ignored) || !bag_files_in(path).empty();
}

Result<std::unique_ptr<Bag>> Bag::open(const fs::path& path) {
  std::unique_ptr<Bag> bag{new Bag};
  std::error_code ignored;
  Result<void> opened{};
  if (!fs::exists(path, ignored)) {
    opened = fail(ErrorCode::kNotFound, "{}: no such file or folder", path.native());
  } else if (!fs::is_directory(path, ignored)) {
    opened = bag->open_scanned({path});
  } else if (!fs::exists(path / kMetadataName, ignored)) {
    opened = bag->open_scanned(bag_files_in(path));
  } else {
    opened = read_small_file(path / kMetadataName)
                 .and_then([&](const std::string& yaml) {
                   return parse_metadata(yaml, (path / kMetadataName).native());
                 })
                 .and_then(
                     [&](const Metadata& metadata) { return bag->open_described(path, metadata); });
  }
  if (!opened) {
    return tl::unexpected{std::move(opened).error()};
  }
  if (bag->parts_.empty()) {
    return fail(ErrorCode::kNotFound,
                "{}: holds no bag: neither metadata.yaml nor a .db3 or .mcap file", path.native());
  }
  std::ranges::sort(bag->parts_, [](const Part& a, const Part& b) {
    return std::tie(a.start_ns, a.path) < std::tie(b.start_ns, b.path);
  });
  // A bag that cannot be read should say so now. Kept open: a compressed file is decompressed once.
  auto first = open_part(bag->parts_.front());
  if (!first) {
    return tl::unexpected{std::move(first).error()};
  }
  bag->parts_.front().file = std::move(*first);
  return bag;
}

Result<std::shared_ptr<BagFile>> Bag::open_part(const Part& part) {
  if (part.file) {
    return part.file;
  }
  return BagFile::open(part.path).map(
      [](auto file) { return std::shared_ptr<BagFile>{std::move(file)}; });
}

Result<void> Bag::open_described(const fs::path& folder, const Metadata& metadata) {
  const std::string where = (folder / kMetadataName).native();
  if (metadata.storage_identifier != "sqlite3" && metadata.storage_identifier != "mcap") {
    return fail(
        ErrorCode::kUnsupported,
        "{}: storage '{}' is not supported, only sqlite3 and mcap; `ros2 bag convert` makes "
        "one of the other",
        where, metadata.storage_identifier);
  }
  if (!metadata.compression_format.empty() && metadata.compression_format != "zstd") {
    return fail(ErrorCode::kUnsupported, "{}: compression '{}' is not supported, only zstd", where,
                metadata.compression_format);
  }
  for (const TopicMetadata& topic : metadata.topics) {
    topics_.push_back({.name = topic.name, .type = topic.type, .count = topic.message_count});
  }
  start_ns_ = metadata.start_ns;
  end_ns_ = is_time(metadata.start_ns) && is_time(metadata.duration_ns)
                ? metadata.start_ns + metadata.duration_ns
                : metadata.start_ns;
  custom_data_ = metadata.custom_data;
  for (const std::string& relative : metadata.relative_file_paths) {
    Part part{.path = resolve(folder, relative), .start_ns = metadata.start_ns};
    const auto described = std::ranges::find(metadata.files, relative, &FileMetadata::path);
    if (described != metadata.files.end()) {
      part.start_ns = described->start_ns;
    } else if (metadata.relative_file_paths.size() > 1) {
      auto start =
          BagFile::open(part.path).and_then([](const auto& file) { return file->start_ns(); });
      if (!start) {
        return tl::unexpected{std::move(start).error()};
      }
      part.start_ns = start->value_or(metadata.start_ns);
    }
    parts_.push_back(std::move(part));
  }
  return {};
}

Result<void> Bag::open_scanned(const std::vector<fs::path>& files) {
  for (const fs::path& path : files) {
    auto file = BagFile::open(path);
    if (!file) {
      return tl::unexpected{std::move(file).error()};
    }
    auto extent = (*file)->extent();
    if (!extent) {
      return tl::unexpected{std::move(extent).error()};
    }
    add(**file, *extent);
    if (const auto yaml = (*file)->stored_metadata()) {
      if (auto metadata = parse_metadata(*yaml, path.native())) {
        custom_data_.merge(metadata->custom_data);
      }
    }
  }
  return {};
}

void Bag::add(const BagFile& file, const BagFile::Extent& extent) {
  start_ns_ = parts_.empty() ? extent.start_ns : std::min(start_ns_, extent.start_ns);
  end_ns_ = parts_.empty() ? extent.end_ns : std::max(end_ns_, extent.end_ns);
  parts_.push_back({.path = file.path(), .start_ns = extent.start_ns});
  for (std::size_t i = 0; i < file.topics().size(); ++i) {
    const FileTopic& topic = file.topics()[i];
    auto known = std::ranges::find(topics_, topic.name, &BagTopic::name);
    if (known == topics_.end()) {
      known = topics_.insert(topics_.end(), {.name = topic.name, .type = topic.type});
    }
    known->count += extent.counts[i];
  }
}

const BagTopic* Bag::find(std::string_view name) const {
  const auto found = std::ranges::find(topics_, name, &BagTopic::name);
  return found == topics_.end() ? nullptr : &*found;
}

void Bag::scan(const std::function<bool(std::string_view)>& wanted,
               const std::function<void(const BagMessage&)>& visit,
               const std::function<bool()>& enough) {
  for (const Part& part : parts_) {
    const auto file = open_part(part);
    if (!file || !(*file)->select([&](const FileTopic& topic) { return wanted(topic.name); })) {
      continue;
    }
    while (const auto row = (*file)->next().value_or(std::nullopt)) {
      const FileTopic& topic = (*file)->topics()[row->topic];
      if (const auto data = (*file)->data(*row)) {
        visit({.topic = topic.name,
               .type = topic.type,
               .timestamp_ns = row->timestamp_ns,
               .data = *data,
               .origin = (*file)->describe(*row)});
      }
    }
    if (enough()) {
      return;
    }
  }
}

void Bag::select(std::function<bool(std::string_view)> wanted) {
  wanted_ = std::move(wanted);
  waiting_.assign(parts_.begin(), parts_.end());
  open_.clear();
  delivered_.reset();
  complete_ = true;
}

Result<std::optional<BagMessage>> Bag::next() {
  Result<void> ready{};
  if (delivered_) {
    const std::size_t last = *delivered_;
    delivered_.reset();
    ready = advance(last);
  }
  ready = ready.and_then([this] { return open_due_parts(); });
  if (!ready) {
    complete_ = false;
    return tl::unexpected{std::move(ready).error()};
  }
  if (open_.empty()) {
    return std::nullopt;
  }
  const auto first = std::ranges::min_element(
      open_, {}, [](const OpenPart& part) { return part.row.timestamp_ns; });
  delivered_ = static_cast<std::size_t>(first - open_.begin());
  if (!is_time(first->row.timestamp_ns)) {
    return fail(ErrorCode::kInvalidData, "{}: time {} ns is out of range",
                first->file->describe(first->row), first->row.timestamp_ns);
  }
  const auto data = first->file->data(first->row);
  if (!data) {
    return tl::unexpected{data.error()};
  }
  const FileTopic& topic = first->file->topics()[first->row.topic];
  if (topic.serialization_format != "cdr") {
    return fail(ErrorCode::kUnsupported, "{}: serialization '{}' is not supported, only cdr",
                first->file->describe(first->row), topic.serialization_format);
  }
  return BagMessage{.topic = topic.name,
                    .type = topic.type,
                    .timestamp_ns = first->row.timestamp_ns,
                    .data = *data,
                    .origin = first->file->describe(first->row)};
}

Result<void> Bag::open_due_parts() {
  const auto due = [this] {
    return !waiting_.empty() && std::ranges::all_of(open_, [this](const OpenPart& part) {
      return part.row.timestamp_ns >= waiting_.front().start_ns;
    });
  };
  while (due()) {
    const Part part = std::move(waiting_.front());
    waiting_.pop_front();
    auto file = open_part(part);
    if (!file) {
      return tl::unexpected{std::move(file).error()};
    }
    if (auto selected =
            (*file)->select([this](const FileTopic& topic) { return wanted_(topic.name); });
        !selected) {
      return selected;
    }
    open_.push_back({.file = std::move(*file), .row = {}});
    if (auto advanced = advance(open_.size() - 1); !advanced) {
      return advanced;
    }
  }
  return {};
}

Result<void> Bag::advance(std::size_t index) {
  auto row = open_[index].file->next();
  if (const std::optional<MessageRow> found = row.value_or(std::nullopt)) {
    open_[index].row = *found;
    return {};
  }
  if (!row) {
    delivered_ = index;  // it may go on behind what is damaged
    return tl::unexpected{std::move(row).error()};
  }
  open_.erase(open_.begin() + static_cast<std::ptrdiff_t>(index));
  return {};
}

}  // namespace geoflow::drivers::bag
