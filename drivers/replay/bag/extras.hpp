#pragma once

#include <map>
#include <optional>
#include <string>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers::bag {

/// What a bag of this project says in metadata.yaml's custom_data, because no standard message can:
/// keys `geoflow.depth_unit_m`, `geoflow.depth_alignment`, `geoflow.timeshift_cam_imu_ns`,
/// `geoflow.imu_noise.*`, `geoflow.stamps.*` (docs/recordings.md).
struct Extras {
  std::optional<double> depth_unit_m{};
  std::optional<DepthAlignment> depth_alignment{};
  std::optional<Duration> timeshift_cam_imu{};
  std::optional<ImuNoise> imu_noise{};
  RecordingStamps stamps{};
};

using CustomData = std::map<std::string, std::string>;

/// Values that are not numbers or out of range are passed over, as if they were not there. Pure.
[[nodiscard]] Extras parse_extras(const CustomData& custom_data);
/// Numbers so that they read back exactly. Pure.
[[nodiscard]] CustomData to_custom_data(const Extras& extras);

}  // namespace geoflow::drivers::bag
