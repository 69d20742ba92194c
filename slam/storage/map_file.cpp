#include "storage/map_file.hpp"

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <tl/expected.hpp>
#include <unistd.h>
#include <zconf.h>
#include <zlib.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "storage/bytes.hpp"

namespace geoflow::slam {
namespace {

constexpr std::uint64_t kMagic = 0x50414D574F4C4647;  // "GFLOWMAP"
constexpr std::uint32_t kVersion = 2;
constexpr std::size_t kHeaderBytes = 40;
constexpr std::size_t kEntryBytes = 28;
constexpr mode_t kMode = 0644;

std::uint32_t checksum(std::span<const std::byte> bytes) {
  // zlib asks for unsigned char.
  const auto* data =
      reinterpret_cast<const Bytef*>(bytes.data());  // NOLINT(*-reinterpret-cast): bytes
  return static_cast<std::uint32_t>(::crc32_z(0, data, bytes.size()));
}

struct Header {
  std::uint32_t sections = 0;
  std::uint64_t directory_offset = 0;
  std::uint64_t file_bytes = 0;
  std::uint32_t directory_checksum = 0;
};

std::vector<std::byte> encode(const Header& header) {
  ByteWriter writer;
  writer.put(kMagic);
  writer.put(kVersion);
  writer.put(header.sections);
  writer.put(header.directory_offset);
  writer.put(header.file_bytes);
  writer.put(header.directory_checksum);
  std::vector<std::byte> bytes = writer.take();
  ByteWriter end;
  end.put(checksum(bytes));
  const std::vector<std::byte> sum = end.take();
  bytes.insert(bytes.end(), sum.begin(), sum.end());
  return bytes;
}

std::vector<std::byte> encode(std::span<const Section> directory) {
  ByteWriter writer;
  for (const Section& section : directory) {
    writer.put(static_cast<std::uint32_t>(section.tag));
    writer.put(section.key);
    writer.put(section.offset);
    writer.put(section.length);
    writer.put(section.checksum);
  }
  return writer.take();
}

Result<Header> decode_header(std::span<const std::byte> bytes, const std::string& name) {
  ByteReader reader{bytes};
  if (reader.get<std::uint64_t>() != kMagic) {
    return fail(ErrorCode::kInvalidData, "{}: not a map: it does not begin like one", name);
  }
  const std::uint32_t version = reader.u32();
  if (version != kVersion) {
    return fail(ErrorCode::kUnsupported, "{}: a map of version {}; this program reads version {}",
                name, version, kVersion);
  }
  Header header;
  header.sections = reader.u32();
  header.directory_offset = reader.get<std::uint64_t>();
  header.file_bytes = reader.get<std::uint64_t>();
  header.directory_checksum = reader.u32();
  const std::size_t covered = reader.offset();
  if (reader.u32() != checksum(bytes.first(covered))) {
    return fail(ErrorCode::kInvalidData, "{}: damaged: the header's checksum is wrong", name);
  }
  return header;
}

/// The new file while it is written: under another name, locked, and gone unless it is finished.
class TemporaryFile {
 public:
  explicit TemporaryFile(std::filesystem::path path) : path_{std::move(path)} {}
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (fd_ && !moved_) {
      ::unlink(path_.c_str());
    }
  }

  [[nodiscard]] Result<void> open() {
    UniqueFd fd{::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, kMode)};
    if (!fd) {
      return fail_errno(fmt::format("{}: cannot be written", path_.string()));
    }
    if (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0) {
      return fail(ErrorCode::kUnavailable, "{}: somebody else is writing it", path_.string());
    }
    // Who had the lock before may have given the file its name meanwhile.
    struct stat locked{};
    struct stat named{};
    if (::fstat(fd.get(), &locked) != 0 || ::stat(path_.c_str(), &named) != 0 ||
        locked.st_ino != named.st_ino) {
      return fail(ErrorCode::kUnavailable, "{}: somebody else has just written it", path_.string());
    }
    fd_ = std::move(fd);
    if (::ftruncate(fd_.get(), 0) != 0) {
      return fail_errno(path_.string());
    }
    return {};
  }

  [[nodiscard]] Result<void> write_at(std::uint64_t offset, std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t done =
          ::pwrite(fd_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
      if (done < 0 && errno == EINTR) {
        continue;
      }
      if (done <= 0) {
        return fail_errno(
            fmt::format("{}: writing {} bytes at byte {}", path_.string(), bytes.size(), offset));
      }
      offset += static_cast<std::uint64_t>(done);
      bytes = bytes.subspan(static_cast<std::size_t>(done));
    }
    return {};
  }

  /// To the disk, then under its name, and that to the disk.
  [[nodiscard]] Result<void> finish(const std::filesystem::path& path) {
    if (::fsync(fd_.get()) != 0) {
      return fail_errno(fmt::format("{}: to the disk", path_.string()));
    }
    if (::rename(path_.c_str(), path.c_str()) != 0) {
      return fail_errno(fmt::format("{}: renaming it to {}", path_.string(), path.string()));
    }
    moved_ = true;
    const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
    const UniqueFd opened{::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
    if (!opened || ::fsync(opened.get()) != 0) {
      return fail_errno(fmt::format("{}: the folder, to the disk", folder.string()));
    }
    return {};
  }

 private:
  std::filesystem::path path_;
  UniqueFd fd_;
  bool moved_ = false;
};

}  // namespace

std::string to_string(SectionTag tag) {
  std::string letters;
  constexpr unsigned kByteBits = std::numeric_limits<unsigned char>::digits;
  for (auto rest = static_cast<std::uint32_t>(tag); rest != 0; rest >>= kByteBits) {
    const auto c = static_cast<char>(rest & std::numeric_limits<unsigned char>::max());
    letters.push_back(c >= 'A' && c <= 'Z' ? c : '?');
  }
  return letters;
}

Result<std::shared_ptr<const MapFile>> MapFile::open(const std::filesystem::path& path) {
  // What is no regular file must not be waited for.
  UniqueFd fd{::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  if (!fd) {
    return fail_errno(path.string());
  }
  return open(std::move(fd), path.string());
}

Result<std::shared_ptr<const MapFile>> MapFile::open(UniqueFd fd, std::string name) {
  struct stat status{};
  if (::fstat(fd.get(), &status) != 0) {
    return fail_errno(name);
  }
  if (!S_ISREG(status.st_mode)) {
    return fail(ErrorCode::kInvalidData, "{}: not a map: not a regular file", name);
  }
  auto file = std::make_shared<MapFile>(std::move(fd), std::move(name));
  file->size_bytes_ = static_cast<std::uint64_t>(status.st_size);
  auto read = file->read_directory();
  if (!read) {
    return tl::unexpected{std::move(read.error())};
  }
  return file;
}

Result<std::vector<std::byte>> MapFile::read_at(std::uint64_t offset, std::size_t length) const {
  std::vector<std::byte> bytes(length);
  std::size_t done = 0;
  while (done < length) {
    const ssize_t got =
        ::pread(fd_.get(), bytes.data() + done, length - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) {
      continue;
    }
    if (got < 0) {
      return fail_errno(fmt::format("{}: reading at byte {}", name_, offset + done));
    }
    if (got == 0) {
      return fail(ErrorCode::kInvalidData, "{}: damaged: it ends at byte {}", name_, offset + done);
    }
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

Result<void> MapFile::read_directory() {
  if (size_bytes_ < kHeaderBytes) {
    return fail(ErrorCode::kInvalidData, "{}: not a map: it has only {} bytes", name_, size_bytes_);
  }
  const auto header_bytes = read_at(0, kHeaderBytes);
  if (!header_bytes) {
    return tl::unexpected{header_bytes.error()};
  }
  const auto header = decode_header(*header_bytes, name_);
  if (!header) {
    return tl::unexpected{header.error()};
  }
  if (header->file_bytes != size_bytes_) {
    return fail(ErrorCode::kInvalidData, "{}: damaged: it has {} bytes, and should have {}", name_,
                size_bytes_, header->file_bytes);
  }
  // The header is intact, so these hold unless somebody meant harm.
  if (header->directory_offset > size_bytes_ ||
      (size_bytes_ - header->directory_offset) != kEntryBytes * std::uint64_t{header->sections}) {
    return fail(ErrorCode::kInvalidData, "{}: the directory of {} sections does not end the file",
                name_, header->sections);
  }
  const auto bytes = read_at(header->directory_offset, kEntryBytes * header->sections);
  if (!bytes) {
    return tl::unexpected{bytes.error()};
  }
  if (checksum(*bytes) != header->directory_checksum) {
    return fail(ErrorCode::kInvalidData,
                "{}: damaged: the checksum of the directory at byte {} is "
                "wrong",
                name_, header->directory_offset);
  }
  ByteReader reader{*bytes};
  std::uint64_t expected = kHeaderBytes;
  for (std::uint32_t i = 0; i < header->sections; ++i) {
    Section section;
    section.tag = static_cast<SectionTag>(reader.u32());
    section.key = reader.u32();
    section.offset = reader.get<std::uint64_t>();
    section.length = reader.get<std::uint64_t>();
    section.checksum = reader.u32();
    if (section.offset != expected || section.length > header->directory_offset - expected) {
      return fail(ErrorCode::kInvalidData, "{}: section {} is not where the one before ends", name_,
                  to_string(section.tag));
    }
    expected += section.length;
    sections_.push_back(section);
  }
  if (expected != header->directory_offset) {
    return fail(ErrorCode::kInvalidData, "{}: bytes from {} on belong to no section", name_,
                expected);
  }
  return {};
}

Result<std::vector<std::byte>> MapFile::read(const Section& section) const {
  auto bytes = read_at(section.offset, section.length);
  if (bytes && checksum(*bytes) != section.checksum) {
    return wrong(section, 0, "damaged: the checksum is wrong");
  }
  return bytes;
}

tl::unexpected<Error> MapFile::wrong(const Section& section, std::size_t offset,
                                     std::string_view what) const {
  return fail(ErrorCode::kInvalidData, "{}: section {} at byte {}: {}", name_,
              to_string(section.tag), section.offset + offset, what);
}

Result<void> write_map_file(const std::filesystem::path& path,
                            std::span<const SectionToWrite> sections) {
  TemporaryFile file{path.string() + ".tmp"};
  auto written = file.open();
  std::vector<Section> directory;
  std::uint64_t offset = kHeaderBytes;
  for (const SectionToWrite& section : sections) {
    if (!written) {
      return written;
    }
    const auto bytes = section.bytes();
    if (!bytes) {
      return tl::unexpected{bytes.error()};
    }
    directory.push_back({.tag = section.tag,
                         .key = section.key,
                         .offset = offset,
                         .length = bytes->size(),
                         .checksum = checksum(*bytes)});
    written = file.write_at(offset, *bytes);
    offset += bytes->size();
  }
  const std::vector<std::byte> entries = encode(directory);
  const std::vector<std::byte> header =
      encode(Header{.sections = static_cast<std::uint32_t>(directory.size()),
                    .directory_offset = offset,
                    .file_bytes = offset + entries.size(),
                    .directory_checksum = checksum(entries)});
  return written.and_then([&] { return file.write_at(offset, entries); })
      .and_then([&] { return file.write_at(0, header); })
      .and_then([&] { return file.finish(path); });
}

}  // namespace geoflow::slam
