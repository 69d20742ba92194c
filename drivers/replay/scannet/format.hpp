#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

/// The bytes of ScanNet's `.sens` files, version 4, little-endian: a header, then frames one behind
/// the other, then inertial samples (which have no calibration, and are not read). Source: A. Dai
/// et al., "ScanNet", CVPR 2017, and the SensReader that the data set is published with
/// (github.com/ScanNet/ScanNet, SensReader/README.md).
namespace geoflow::drivers::scannet {

inline constexpr std::uint32_t kVersion = 4;
/// More than any header needs: it is read in one piece.
inline constexpr std::size_t kLargestHeader = 4096;
inline constexpr std::size_t kFrameHeaderBytes = 96;
/// Of one compressed image; more is refused.
inline constexpr std::uint64_t kLargestImage = std::uint64_t{64} << 20U;

enum class ColorCoding : std::uint8_t { kRaw = 0, kPng = 1, kJpeg = 2 };
enum class DepthCoding : std::uint8_t { kRaw = 0, kZlib = 1 };

struct Header {
  std::string sensor;
  CameraIntrinsics color{};
  CameraIntrinsics depth{};
  /// A camera's extrinsic maps to the rig's base, as a rule the colour camera.
  SE3 T_color_depth{};
  ColorCoding color_coding = ColorCoding::kJpeg;
  DepthCoding depth_coding = DepthCoding::kZlib;
  double depth_counts_per_m = 0;
  std::uint64_t frames = 0;    ///< as declared; how many there are, only the file's length says
  std::size_t size_bytes = 0;  ///< the first frame begins here
};

/// What stands before a frame's two images.
struct FrameHeader {
  /// None where the reconstruction lost the camera: it writes infinities.
  std::optional<SE3> T_world_depth{};
  std::uint64_t color_us = 0;  ///< stamps; 0 or noise in many files
  std::uint64_t depth_us = 0;
  std::uint64_t color_bytes = 0;
  std::uint64_t depth_bytes = 0;
};

/// Whether the bytes begin as such a file.
[[nodiscard]] bool has_version(std::span<const std::byte> bytes) noexcept;

/// Reads a header from the first kLargestHeader bytes of `file` (fewer where it is smaller). Pure.
/// Errors name the file and the field: cut off, another version, an unknown or unsupported coding
/// (`occi`), sizes, intrinsics or a depth shift out of range, an extrinsic that is no transform.
[[nodiscard]] Result<Header> parse_header(std::string_view file, std::span<const std::byte> bytes);

/// Reads what stands before a frame's images. Pure; any bytes are a frame header.
[[nodiscard]] FrameHeader parse_frame_header(
    std::span<const std::byte, kFrameHeaderBytes> bytes) noexcept;

/// The depth image of a frame, row by row: exactly width * height values. Pure. Errors without
/// place: damaged or with a wrong length.
[[nodiscard]] Result<std::vector<std::uint16_t>> decode_depth(const Header& header,
                                                              std::span<const std::byte> bytes);

}  // namespace geoflow::drivers::scannet
