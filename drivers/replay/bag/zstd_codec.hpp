#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

/// Zstandard as rosbag2 uses it: around single messages, or around a whole storage file.
namespace geoflow::drivers::bag {

/// Whether the bytes begin with a Zstandard frame. No CDR message and no SQLite file begins like
/// that.
[[nodiscard]] bool is_zstd(std::span<const std::byte> bytes) noexcept;

/// The content of one frame, at most 64 MiB; a frame that does not state its size is refused, since
/// rosbag2's state theirs. Pure.
[[nodiscard]] Result<std::vector<std::byte>> decompress(std::span<const std::byte> frame);

/// One frame around `bytes` that states its size. Thread-compatible: keeps its working memory from
/// call to call.
class Compressor {
 public:
  explicit Compressor(int level);
  Compressor(const Compressor&) = delete;
  Compressor& operator=(const Compressor&) = delete;
  Compressor(Compressor&&) = delete;
  Compressor& operator=(Compressor&&) = delete;
  ~Compressor();
  [[nodiscard]] Result<std::vector<std::byte>> compress(std::span<const std::byte> bytes);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A file that is deleted when its owner goes.
class TemporaryFile {
 public:
  /// In the folder that TMPDIR names, else /tmp.
  [[nodiscard]] static Result<TemporaryFile> create();
  TemporaryFile(TemporaryFile&& other) noexcept;
  TemporaryFile& operator=(TemporaryFile&& other) noexcept;
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile();

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] Result<void> write(std::span<const std::byte> bytes);

 private:
  TemporaryFile() = default;
  std::filesystem::path path_;
  UniqueFd fd_;
};

/// Decompresses a whole file into a temporary one. Refused before anything is written where the
/// first frame states more than `max_bytes` or more than the temporary folder has room for, and
/// given up where the content turns out to be more than `max_bytes`.
[[nodiscard]] Result<TemporaryFile> decompress_file(const std::filesystem::path& path,
                                                    std::uint64_t max_bytes);

}  // namespace geoflow::drivers::bag
