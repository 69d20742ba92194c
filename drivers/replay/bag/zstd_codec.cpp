#include "replay/bag/zstd_codec.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/types.h>
#include <tl/expected.hpp>
#include <unistd.h>
#include <zstd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::drivers::bag {
namespace {

constexpr std::uint64_t kMaxMessageBytes = std::uint64_t{64} << 20U;

struct FreeDecompressor {
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

Result<std::size_t> read_some(const UniqueFd& fd, std::span<std::byte> buffer,
                              const std::string& name) {
  while (true) {
    const ssize_t count = ::read(fd.get(), buffer.data(), buffer.size());
    if (count >= 0) {
      return static_cast<std::size_t>(count);
    }
    if (errno != EINTR) {
      return fail_errno(name);
    }
  }
}

/// Refuses a frame that states a size which is not wanted or for which there is no room.
Result<void> check_stated_size(std::span<const std::byte> head, const std::string& name,
                               std::uint64_t max_bytes) {
  const unsigned long long stated = ZSTD_getFrameContentSize(head.data(), head.size());
  if (stated == ZSTD_CONTENTSIZE_ERROR) {
    return fail(ErrorCode::kInvalidData, "{}: is not a Zstandard file", name);
  }
  if (stated == ZSTD_CONTENTSIZE_UNKNOWN) {
    return {};
  }
  if (stated > max_bytes) {
    return fail(ErrorCode::kUnsupported, "{}: holds {} bytes, more than the limit of {}", name,
                stated, max_bytes);
  }
  std::error_code error;
  const auto folder = std::filesystem::temp_directory_path(error);
  const auto space = std::filesystem::space(folder, error);
  if (!error && space.available < stated) {
    return fail(ErrorCode::kUnavailable,
                "{}: needs {} bytes in {}, which has {} left; set TMPDIR to another folder", name,
                stated, folder.native(), space.available);
  }
  return {};
}

/// Feeds one piece of the compressed file through; false once the last frame is complete up to
/// here.
class FileDecompressor {
 public:
  FileDecompressor(const std::string& name, std::uint64_t max_bytes)
      : name_{name}, left_bytes_{max_bytes} {}

  Result<void> feed(std::span<const std::byte> piece, TemporaryFile& target) {
    ZSTD_inBuffer in{piece.data(), piece.size(), 0};
    bool flushed = true;
    while (in.pos < in.size || !flushed) {
      ZSTD_outBuffer out{buffer_.data(), buffer_.size(), 0};
      const std::size_t code = ZSTD_decompressStream(context_.get(), &out, &in);
      if (ZSTD_isError(code) != 0U) {
        return fail(ErrorCode::kInvalidData, "{}: {}", name_, ZSTD_getErrorName(code));
      }
      mid_frame_ = code != 0;
      flushed = out.pos < out.size;
      if (out.pos > left_bytes_) {
        return fail(ErrorCode::kUnsupported, "{}: holds more bytes than the limit allows", name_);
      }
      left_bytes_ -= out.pos;
      if (auto written = target.write(std::span{buffer_}.first(out.pos)); !written) {
        return written;
      }
    }
    return {};
  }
  [[nodiscard]] bool mid_frame() const noexcept { return mid_frame_; }

 private:
  std::string name_;
  std::uint64_t left_bytes_;
  bool mid_frame_ = false;
  std::unique_ptr<ZSTD_DCtx, FreeDecompressor> context_{ZSTD_createDCtx()};
  std::vector<std::byte> buffer_ = std::vector<std::byte>(ZSTD_DStreamOutSize());
};

}  // namespace

bool is_zstd(std::span<const std::byte> bytes) noexcept {
  constexpr std::array kMagic{std::byte{0x28}, std::byte{0xb5}, std::byte{0x2f}, std::byte{0xfd}};
  return bytes.size() >= kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), bytes.begin());
}

Result<std::vector<std::byte>> decompress(std::span<const std::byte> frame) {
  const unsigned long long stated = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (stated == ZSTD_CONTENTSIZE_ERROR || stated == ZSTD_CONTENTSIZE_UNKNOWN) {
    return fail(ErrorCode::kInvalidData, "a Zstandard frame of {} bytes does not state its size",
                frame.size());
  }
  if (stated > kMaxMessageBytes) {
    return fail(ErrorCode::kInvalidData,
                "a Zstandard frame states {} bytes, more than a message may have", stated);
  }
  std::vector<std::byte> content(stated);
  const std::size_t size =
      ZSTD_decompress(content.data(), content.size(), frame.data(), frame.size());
  if (ZSTD_isError(size) != 0U || size != stated) {
    return fail(ErrorCode::kInvalidData, "a damaged Zstandard frame: {}", ZSTD_getErrorName(size));
  }
  return content;
}

struct Compressor::State {
  struct Free {
    void operator()(ZSTD_CCtx* owned) const { ZSTD_freeCCtx(owned); }
  };
  std::unique_ptr<ZSTD_CCtx, Free> context{ZSTD_createCCtx()};
  int level = 1;
};

Compressor::Compressor(int level) : state_{std::make_unique<State>()} {
  state_->level = level;
}
Compressor::~Compressor() = default;

Result<std::vector<std::byte>> Compressor::compress(std::span<const std::byte> bytes) {
  std::vector<std::byte> frame(ZSTD_compressBound(bytes.size()));
  const std::size_t size = ZSTD_compressCCtx(state_->context.get(), frame.data(), frame.size(),
                                             bytes.data(), bytes.size(), state_->level);
  if (ZSTD_isError(size) != 0U) {
    return fail(ErrorCode::kSystem, "Zstandard: {}", ZSTD_getErrorName(size));
  }
  frame.resize(size);
  return frame;
}

Result<TemporaryFile> TemporaryFile::create() {
  std::error_code error;
  const auto folder = std::filesystem::temp_directory_path(error);
  if (error) {
    return fail(ErrorCode::kSystem, "no folder for temporary files: {}", error.message());
  }
  std::string name = (folder / "geoflow-XXXXXX.db3").native();
  constexpr int kSuffixLength = 4;
  TemporaryFile file;
  file.fd_.reset(::mkostemps(name.data(), kSuffixLength, O_CLOEXEC));
  if (!file.fd_) {
    return fail_errno(name);
  }
  file.path_ = name;
  return file;
}

TemporaryFile::TemporaryFile(TemporaryFile&& other) noexcept
    : path_{std::exchange(other.path_, {})}, fd_{std::move(other.fd_)} {}

TemporaryFile& TemporaryFile::operator=(TemporaryFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(fd_, other.fd_);
  return *this;
}

TemporaryFile::~TemporaryFile() {
  if (!path_.empty()) {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
}

Result<void> TemporaryFile::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(fd_.get(), bytes.data(), bytes.size());
    if (count < 0 && errno != EINTR) {
      return fail_errno(path_.native());
    }
    bytes = bytes.subspan(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  }
  return {};
}

Result<TemporaryFile> decompress_file(const std::filesystem::path& path, std::uint64_t max_bytes) {
  const std::string& name = path.native();
  const UniqueFd source{::open(name.c_str(), O_RDONLY | O_CLOEXEC)};
  if (!source) {
    return fail_errno(name);
  }
  auto target = TemporaryFile::create();
  if (!target) {
    return target;
  }
  FileDecompressor decompressor{name, max_bytes};
  std::vector<std::byte> buffer(ZSTD_DStreamInSize());
  for (bool first = true;; first = false) {
    const auto count = read_some(source, buffer, name);
    if (!count) {
      return tl::unexpected{count.error()};
    }
    const auto piece = std::span<const std::byte>{buffer}.first(*count);
    auto fed = first ? check_stated_size(piece, name, max_bytes) : Result<void>{};
    if (fed && !piece.empty()) {
      fed = decompressor.feed(piece, *target);
    }
    if (!fed) {
      return tl::unexpected{std::move(fed).error()};
    }
    if (piece.empty()) {
      break;
    }
  }
  if (decompressor.mid_frame()) {
    return fail(ErrorCode::kInvalidData, "{}: is cut off inside its compressed content", name);
  }
  return target;
}

}  // namespace geoflow::drivers::bag
