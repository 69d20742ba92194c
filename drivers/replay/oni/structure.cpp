#include "replay/oni/structure.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <istream>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "fields.hpp"

namespace geoflow::drivers::oni {
namespace {

constexpr std::string_view kMagic = "NI10";
constexpr std::size_t kFileHeaderBytes = 24;
constexpr std::uint32_t kRecordMagic = 0x0052494e;  // "NIR"
constexpr std::uint32_t kRecordHeaderBytes = 28;
// Names and properties are short; the largest property is the list of a sensor's modes.
constexpr std::uint32_t kLargestFields = 1U << 20U;
constexpr std::uint32_t kLargestImage = 1U << 28U;
constexpr std::size_t kMostNodes = 64;
constexpr int kLargestSide = 8192;

enum class RecordType : std::uint32_t {
  kIntProperty = 0x03,
  kGeneralProperty = 0x06,
  kNewData = 0x0a,
  kEnd = 0x0b,
  kNodeAddedOld = 0x0c,  // 1.0.0.5
  kNodeAdded = 0x0d,
};

struct RecordHeader {
  std::uint32_t magic = 0;
  std::uint32_t type = 0;
  std::uint32_t node = 0;
  std::uint32_t field_bytes = 0;  // with this header
  std::uint32_t payload_bytes = 0;
};

std::string_view text_of(std::span<const std::byte> bytes) {
  const void* const first = bytes.data();
  const std::string_view text{static_cast<const char*>(first), bytes.size()};
  return text.substr(0, text.find('\0'));
}

/// A length and so many bytes.
std::span<const std::byte> take_block(FieldReader& fields) {
  return fields.take_bytes(fields.take<std::uint32_t>());
}

class Walker {
 public:
  Walker(std::string name, std::istream& file, std::uint64_t size)
      : name_{std::move(name)}, file_{file}, size_{size} {}

  [[nodiscard]] Result<Structure> walk() {
    const auto header = read(0, kFileHeaderBytes);
    if (header.size() < kFileHeaderBytes || text_of(std::span{header}.first(4)) != kMagic) {
      return fail(ErrorCode::kInvalidData, "{}: is no OpenNI recording", name_);
    }
    at_ = kFileHeaderBytes;
    while (!found_.complete && at_ < size_ && !cut_off_) {
      if (auto done = step(); !done) {
        return tl::unexpected{std::move(done.error())};
      }
    }
    found_.bytes = at_;
    return std::move(found_);
  }

 private:
  [[nodiscard]] std::vector<std::byte> read(std::uint64_t offset, std::size_t count) {
    std::vector<std::byte> bytes(count);
    void* const target = bytes.data();
    file_.clear();
    file_.seekg(static_cast<std::streamoff>(offset));
    file_.read(static_cast<char*>(target), static_cast<std::streamsize>(count));
    bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(file_.gcount(), 0)));
    return bytes;
  }

  [[nodiscard]] Result<void> broken(std::string_view why) const {
    return fail(ErrorCode::kInvalidData, "{}: byte {}: {}", name_, at_, why);
  }

  /// Takes the next record, if it is there as a whole.
  [[nodiscard]] Result<void> step() {
    const auto head = read(at_, kRecordHeaderBytes);
    FieldReader fields{head};
    const RecordHeader record{.magic = fields.take<std::uint32_t>(),
                              .type = fields.take<std::uint32_t>(),
                              .node = fields.take<std::uint32_t>(),
                              .field_bytes = fields.take<std::uint32_t>(),
                              .payload_bytes = fields.take<std::uint32_t>()};
    cut_off_ = !fields.ok();
    if (cut_off_) {
      return {};
    }
    if (record.magic != kRecordMagic || record.field_bytes < kRecordHeaderBytes) {
      return broken("here should be a record");
    }
    if (record.field_bytes > kLargestFields || record.payload_bytes > kLargestImage) {
      return broken("a record is longer than any");
    }
    cut_off_ = size_ - at_ < std::uint64_t{record.field_bytes} + record.payload_bytes;
    if (cut_off_) {
      return {};
    }
    const auto content = read(at_ + kRecordHeaderBytes, record.field_bytes - kRecordHeaderBytes);
    if (auto understood = understand(record, content); !understood) {
      return understood;
    }
    at_ += std::uint64_t{record.field_bytes} + record.payload_bytes;
    return {};
  }

  [[nodiscard]] Result<void> understand(const RecordHeader& record,
                                        std::span<const std::byte> content) {
    FieldReader fields{content};
    switch (static_cast<RecordType>(record.type)) {
      case RecordType::kNodeAdded:
      case RecordType::kNodeAddedOld:
        return add_node(record.node, fields);
      case RecordType::kIntProperty:
      case RecordType::kGeneralProperty:
        return set_property(record.node, fields);
      case RecordType::kNewData:
        return add_frame(record, fields);
      case RecordType::kEnd:
        found_.complete = true;
        return {};
    }
    return {};  // others say nothing about images
  }

  [[nodiscard]] Result<void> add_node(std::uint32_t id, FieldReader& fields) {
    (void)take_block(fields);  // its name
    const Node node{.id = id,
                    .kind = static_cast<NodeKind>(fields.take<std::uint32_t>()),
                    .codec = static_cast<Codec>(fields.take<std::uint32_t>())};
    if (!fields.ok()) {
      return broken("a stream's description is cut off");
    }
    const bool image = node.kind == NodeKind::kDepth || node.kind == NodeKind::kColor ||
                       node.kind == NodeKind::kInfrared;
    if (image && this->node(id) == nullptr) {
      if (found_.nodes.size() == kMostNodes) {
        return broken("more streams than any recording has");
      }
      found_.nodes.push_back(node);
    }
    return {};
  }

  [[nodiscard]] Result<void> set_property(std::uint32_t id, FieldReader& fields) {
    const std::string_view name = text_of(take_block(fields));
    FieldReader value{take_block(fields)};
    if (!fields.ok()) {
      return broken("a property is cut off");
    }
    Node* const node = this->node(id);
    if (node == nullptr) {
      return {};
    }
    if (name == "xnMapOutputMode") {
      const auto mode = value.take_array<std::uint32_t, 3>();
      const auto fits = [](std::uint32_t side) { return side > 0 && side <= kLargestSide; };
      if (!value.ok() || !fits(mode[0]) || !fits(mode[1])) {
        return broken("a stream has no size that an image can have");
      }
      node->width = static_cast<int>(mode[0]);
      node->height = static_cast<int>(mode[1]);
      node->rate_hz = static_cast<int>(mode[2]);
    } else if (name == "oniPixelFormat") {
      node->pixel_format = static_cast<int>(value.take<std::uint64_t>());
    } else if (name == "xnFOV") {
      const auto angles_rad = value.take_array<double, 2>();
      if (value.ok()) {
        node->horizontal_fov_rad = angles_rad[0];
        node->vertical_fov_rad = angles_rad[1];
      }
    }
    return {};
  }

  [[nodiscard]] Result<void> add_frame(const RecordHeader& record, FieldReader& fields) {
    const auto t_us = fields.take<std::uint64_t>();
    if (!fields.ok()) {
      return broken("a frame's description is cut off");
    }
    if (const Node* const its = node(record.node)) {
      if (its->width == 0) {
        return broken("a frame comes before its stream's size");
      }
      found_.frames.push_back({.node = record.node,
                               .t_us = t_us,
                               .offset = at_ + record.field_bytes,
                               .bytes = record.payload_bytes});
    }
    return {};
  }

  [[nodiscard]] Node* node(std::uint32_t id) {
    const auto found = std::ranges::find(found_.nodes, id, &Node::id);
    return found != found_.nodes.end() ? &*found : nullptr;
  }

  std::string name_;
  std::istream& file_;
  std::uint64_t size_;
  std::uint64_t at_ = 0;
  bool cut_off_ = false;  // in the middle of a record
  Structure found_;
};

}  // namespace

Result<Structure> read_structure(std::istream& file, std::uint64_t size, const std::string& name) {
  return Walker{name, file, size}.walk();
}

Result<Structure> read_structure(const std::filesystem::path& path) {
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  std::ifstream file{path, std::ios::binary};
  if (error || !file) {
    return fail(ErrorCode::kSystem, "{}: cannot be read", path.string());
  }
  return read_structure(file, size, path.string());
}

Result<void> check_structure(const std::filesystem::path& path) {
  return read_structure(path).and_then([&](const Structure& found) -> Result<void> {
    if (found.frames.empty()) {
      return fail(ErrorCode::kInvalidData, "{}: has no whole frame", path.string());
    }
    if (!found.complete) {
      return fail(ErrorCode::kInvalidData,
                  "{}: is cut off at byte {}, which OpenNI's player does not stand; as a recording "
                  "(source.replay) it can be read up to there",
                  path.string(), found.bytes);
    }
    return {};
  });
}

}  // namespace geoflow::drivers::oni
