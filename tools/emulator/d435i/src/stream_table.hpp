#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

/// What the D435i (firmware 5.12.7 on USB 3) offers to stream. Sources: `lsusb -v` of a D435i
/// (librealsense issues 13589, 3475) and of a D435 (linux-kernel, D. Perchanov, 2023-02-09);
/// `v4l2-ctl --list-formats-ext` of a D435i.
namespace geoflow::emulator {

/// How a format lays out its pixels.
enum class Packing : std::uint8_t {
  kDepth,       ///< u16 depth
  kGray,        ///< u8 left
  kUyvy,        ///< left as U Y0 V Y1
  kGrayPair,    ///< u8 left, u8 right
  kGrayPair12,  ///< 12 bits of right, then of left, in three bytes
  kYuyv,        ///< colour as Y0 U Y1 V
  kBayer,       ///< colour as a raw mosaic, 10 bits in u16
};

struct FrameSize {
  std::uint16_t width = 0;                           ///< [px]
  std::uint16_t height = 0;                          ///< [px]
  std::span<const std::uint32_t> intervals_100ns{};  ///< shortest first
};

struct VideoFormat {
  std::array<std::uint8_t, 16> guid{};
  std::uint8_t bits_per_pixel = 0;
  Packing packing = Packing::kDepth;
  std::uint16_t metadata_code = 0;  ///< in the metadata's configuration block
  std::span<const FrameSize> sizes{};
};

/// One VideoStreaming interface. Formats and sizes are numbered from 1 on the wire.
struct VideoInterface {
  std::uint8_t number = 0;
  std::uint8_t endpoint = 0;
  std::uint8_t name_string = 0;
  std::uint8_t terminal = 0;  ///< the output terminal that feeds it
  std::span<const VideoFormat> formats{};
};

enum class VideoStreamId : std::uint8_t { kDepth, kInfrared, kColor };
inline constexpr std::size_t kVideoStreamCount = 3;

/// The three, in the order of VideoStreamId.
[[nodiscard]] std::span<const VideoInterface, kVideoStreamCount> video_interfaces() noexcept;

/// Whole frames per second of an interval: 1666665 is 6.
[[nodiscard]] constexpr unsigned frames_per_second(std::uint32_t interval_100ns) noexcept {
  constexpr std::uint32_t kIntervalsPerSecond = 10'000'000;
  return (kIntervalsPerSecond + interval_100ns / 2) / interval_100ns;
}

[[nodiscard]] constexpr std::uint32_t row_bytes(const VideoFormat& format,
                                                const FrameSize& size) noexcept {
  return std::uint32_t{size.width} * format.bits_per_pixel / 8;
}

[[nodiscard]] constexpr std::uint32_t frame_bytes(const VideoFormat& format,
                                                  const FrameSize& size) noexcept {
  return row_bytes(format, size) * size.height;
}

}  // namespace geoflow::emulator
