#pragma once

#include <cstdint>
#include <filesystem>
#include <istream>
#include <optional>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"

/// OpenNI's recordings: a header ("NI10"), then records of properties and frames, each with its own
/// length. Source: OpenNI2, Source/Core/OniDataRecords.cpp and OniRecorder.cpp.
namespace geoflow::drivers::oni {

/// How a node's frames are stored.
enum class Codec : std::uint32_t {
  kUncompressed = 0x454e4f4e,    ///< "NONE"
  kJpeg = 0x4745504a,            ///< "JPEG"
  kDepth = 0x507a3631,           ///< "16zP": differences of depth
  kDepthWithTable = 0x547a3631,  ///< "16zT": differences of indices into a table of depths
};

enum class NodeKind : std::uint32_t { kDepth = 2, kColor = 3, kInfrared = 5 };

/// One stream of a recording, by the properties that were recorded before its frames.
struct Node {
  std::uint32_t id = 0;
  NodeKind kind = NodeKind::kDepth;
  Codec codec = Codec::kUncompressed;
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]
  int rate_hz = 0;
  int pixel_format = 0;  ///< OniPixelFormat; 0: not said
  std::optional<double> horizontal_fov_rad{};
  std::optional<double> vertical_fov_rad{};
};

/// One frame's place in the file.
struct StoredFrame {
  std::uint32_t node = 0;  ///< its id
  std::uint64_t t_us = 0;  ///< since the first frame of its own stream, as OpenNI's recorder has it
  std::uint64_t offset = 0;  ///< of its bytes
  std::uint32_t bytes = 0;
};

struct Structure {
  std::vector<Node> nodes;          ///< images only
  std::vector<StoredFrame> frames;  ///< in the file's order
  bool complete = false;            ///< the record that ends a file is there
  std::uint64_t bytes = 0;          ///< of whole records, from the file's beginning
};

/// Walks through all records of `size` bytes without reading images; `name` stands for the file in
/// messages. kInvalidData, naming the byte, where a record is not one or says that it is longer
/// than any; a file that stops before its last record, or in the middle of one, is not complete
/// instead.
[[nodiscard]] Result<Structure> read_structure(std::istream& file, std::uint64_t size,
                                               const std::string& name);
/// The same of a file; kSystem where it cannot be read.
[[nodiscard]] Result<Structure> read_structure(const std::filesystem::path& file);

/// read_structure() for its errors alone, among them a file that is not complete or has no frames:
/// what is refused before OpenNI's own player gets a file. Thread-safe.
[[nodiscard]] Result<void> check_structure(const std::filesystem::path& file);

}  // namespace geoflow::drivers::oni
