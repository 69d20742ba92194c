#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "geoflow/hal/result.hpp"

/// The blocks that the camera puts into its payload headers, each `u32 id, u32 size` (the size
/// counts these eight bytes) and its fields.
///
/// Source: Linux, Documentation/userspace-api/media/v4l/metafmt-d4xx.rst. What a block's flags do
/// not mark as valid is none here.
namespace geoflow::drivers::d435i {

/// When a frame was taken.
struct CaptureTiming {
  std::optional<std::uint32_t> frame_counter{};
  std::optional<std::uint32_t> optical_time_us{};  ///< from a frame's beginning to its middle
  std::optional<std::uint32_t> exposure_us{};
  std::optional<std::uint32_t> frame_interval_us{};
};

/// How the depth imagers and the projector were set.
struct DepthControl {
  std::optional<std::uint32_t> gain{};
  std::optional<std::uint32_t> exposure_us{};
  std::optional<std::uint32_t> laser_power{};  ///< 0 to 360 [mW]
};

/// What the stream is.
struct StreamConfiguration {
  std::optional<std::uint16_t> width{};    ///< [px]
  std::optional<std::uint16_t> height{};   ///< [px]
  std::optional<std::uint16_t> rate_hz{};  ///< frames a second
};

struct FrameMetadata {
  std::optional<CaptureTiming> timing{};
  std::optional<DepthControl> depth{};
  std::optional<StreamConfiguration> configuration{};
};

/// Reads the blocks behind a payload header's standard fields, in whatever order they come; unknown
/// ones are passed over. No bytes: no metadata. kInvalidData where a block reaches over the end or
/// is smaller than its kind. Pure.
[[nodiscard]] Result<FrameMetadata> parse_metadata(std::span<const std::byte> blocks);

}  // namespace geoflow::drivers::d435i
