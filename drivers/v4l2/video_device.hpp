#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::drivers::v4l2 {

/// Four characters as V4L2 numbers them.
[[nodiscard]] constexpr std::uint32_t fourcc(char a, char b, char c, char d) noexcept {
  constexpr unsigned kByte = 8;
  return static_cast<std::uint32_t>(a) | static_cast<std::uint32_t>(b) << kByte |
         static_cast<std::uint32_t>(c) << 2 * kByte | static_cast<std::uint32_t>(d) << 3 * kByte;
}

/// A size and rate that a node offers.
struct NodeMode {
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]
  int rate_hz = 0;
};

/// A filled buffer, borrowed until it is given back.
struct Filled {
  std::uint32_t index = 0;
  std::uint32_t sequence = 0;
  bool damaged = false;
  std::span<const std::byte> bytes;
};

/// One capture node, of video or of metadata, streaming into mapped memory. Thread-bound; nothing
/// waits. Errors: kNotFound, the device is gone; kUnavailable, someone else has it; kSystem.
class VideoDevice {
 public:
  [[nodiscard]] static Result<VideoDevice> open(const std::filesystem::path& path);
  VideoDevice(VideoDevice&&) noexcept = default;
  VideoDevice& operator=(VideoDevice&&) noexcept = default;
  VideoDevice(const VideoDevice&) = delete;
  VideoDevice& operator=(const VideoDevice&) = delete;
  ~VideoDevice() { stop(); }

  [[nodiscard]] int fd() const noexcept { return fd_.get(); }
  [[nodiscard]] bool is_metadata() const noexcept { return metadata_; }
  [[nodiscard]] bool streaming() const noexcept { return streaming_; }

  [[nodiscard]] bool has_format(std::uint32_t code) const;
  [[nodiscard]] std::vector<NodeMode> modes(std::uint32_t code) const;

  /// Sets format and rate of a video node; kUnsupported where the driver gives another one.
  [[nodiscard]] Result<void> set_video_format(std::uint32_t code, const NodeMode& mode);
  /// Sets the first format of `codes` that a metadata node takes.
  [[nodiscard]] Result<void> set_metadata_format(std::span<const std::uint32_t> codes);

  /// Maps `buffers` buffers and starts.
  [[nodiscard]] Result<void> start(int buffers);
  /// Harmless when stopped.
  void stop() noexcept;
  /// The next filled buffer; none while there is none.
  [[nodiscard]] Result<std::optional<Filled>> take();
  [[nodiscard]] Result<void> give_back(const Filled& filled);

  /// A request to an extension unit of the camera (UVCIOC_CTRL_QUERY). kUnavailable where the
  /// camera stalls it or is busy.
  [[nodiscard]] Result<void> query_unit(std::uint8_t unit, std::uint8_t selector,
                                        std::uint8_t request, std::span<std::byte> data);

 private:
  struct Unmap {
    std::size_t size = 0;
    void operator()(std::byte* memory) const noexcept;
  };
  using Mapping = std::unique_ptr<std::byte, Unmap>;

  VideoDevice(UniqueFd fd, std::string name, bool metadata)
      : fd_{std::move(fd)}, name_{std::move(name)}, metadata_{metadata} {}
  [[nodiscard]] std::uint32_t buffer_type() const noexcept;
  [[nodiscard]] int ioctl(unsigned long request, void* argument) const noexcept;
  [[nodiscard]] tl::unexpected<Error> error(const char* what) const;

  UniqueFd fd_;
  std::string name_;
  bool metadata_ = false;
  bool streaming_ = false;
  std::vector<Mapping> buffers_;
};

}  // namespace geoflow::drivers::v4l2
