#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

/// The container of a map file, whatever its sections hold: docs/map-file.md.
namespace geoflow::slam {

/// What a section holds; four letters in the file.
enum class SectionTag : std::uint32_t {
  kIdentity = 0x4E454449,   ///< "IDEN"
  kKeyframes = 0x4659454B,  ///< "KEYF"
  kPoints = 0x53544E50,     ///< "PNTS"
  kEdges = 0x45474445,      ///< "EDGE"
  kJoins = 0x4E494F4A,      ///< "JOIN"
  kPlace = 0x43414C50,      ///< "PLAC", of the keyframe that is the key
  kCloud = 0x554F4C43,      ///< "CLOU", of the keyframe that is the key
};

/// The four letters, for people.
[[nodiscard]] std::string to_string(SectionTag tag);

/// One entry of the directory.
struct Section {
  SectionTag tag{};
  std::uint32_t key = 0;
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::uint32_t checksum = 0;  ///< CRC-32 of the section's bytes
};

/// A map file that is open: its header and directory were tested, its sections are when they are
/// read. It stays readable when another file takes its name. Immutable; thread-safe.
class MapFile {
 public:
  /// Errors: kNotFound, kSystem; kInvalidData for what is no map or a damaged one, kUnsupported for
  /// one of another version.
  [[nodiscard]] static Result<std::shared_ptr<const MapFile>> open(
      const std::filesystem::path& path);
  /// The same of an open file; `name` stands in errors.
  [[nodiscard]] static Result<std::shared_ptr<const MapFile>> open(UniqueFd fd, std::string name);

  MapFile(UniqueFd fd, std::string name) : fd_{std::move(fd)}, name_{std::move(name)} {}

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] std::uint64_t size_bytes() const noexcept { return size_bytes_; }
  [[nodiscard]] std::span<const Section> sections() const noexcept { return sections_; }
  /// A section's bytes, if they have its checksum.
  [[nodiscard]] Result<std::vector<std::byte>> read(const Section& section) const;
  /// `file: section TAG at byte N: what`.
  [[nodiscard]] tl::unexpected<Error> wrong(const Section& section, std::size_t offset,
                                            std::string_view what) const;

 private:
  [[nodiscard]] Result<std::vector<std::byte>> read_at(std::uint64_t offset,
                                                       std::size_t length) const;
  [[nodiscard]] Result<void> read_directory();

  UniqueFd fd_;
  std::string name_;
  std::uint64_t size_bytes_ = 0;
  std::vector<Section> sections_;
};

/// A section to be written; its bytes are asked for when its turn comes.
struct SectionToWrite {
  SectionTag tag{};
  std::uint32_t key = 0;
  std::function<Result<std::vector<std::byte>>()> bytes;
};

/// Writes a map file so that `path` is the old file or the whole new one, whatever happens: to
/// `path`.tmp, then to the disk, then under its name. Errors: kUnavailable where somebody else is
/// writing the same file, kSystem (a full disk), and those of the sections' bytes; nothing is left
/// behind then.
[[nodiscard]] Result<void> write_map_file(const std::filesystem::path& path,
                                          std::span<const SectionToWrite> sections);

}  // namespace geoflow::slam
