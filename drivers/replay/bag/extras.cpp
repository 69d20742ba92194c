#include "replay/bag/extras.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include <fmt/core.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers::bag {
namespace {

constexpr const char* kDepthUnit = "geoflow.depth_unit_m";
constexpr const char* kDepthAlignment = "geoflow.depth_alignment";
constexpr const char* kTimeshift = "geoflow.timeshift_cam_imu_ns";

constexpr std::array<std::pair<const char*, double ImuNoise::*>, 5> kNoise{{
    {"geoflow.imu_noise.accel_noise_density", &ImuNoise::accel_noise_density},
    {"geoflow.imu_noise.accel_random_walk", &ImuNoise::accel_random_walk},
    {"geoflow.imu_noise.gyro_noise_density", &ImuNoise::gyro_noise_density},
    {"geoflow.imu_noise.gyro_random_walk", &ImuNoise::gyro_random_walk},
    {"geoflow.imu_noise.rate_hz", &ImuNoise::rate_hz},
}};

/// Streams whose stamps a device made: the value is the counter's period in nanoseconds, 0 for one
/// that does not wrap.
constexpr std::array<std::pair<const char*, StampInfo RecordingStamps::*>, 3> kDeviceStamps{{
    {"geoflow.stamps.camera_device_wrap_ns", &RecordingStamps::camera},
    {"geoflow.stamps.imu_device_wrap_ns", &RecordingStamps::imu},
    {"geoflow.stamps.legs_device_wrap_ns", &RecordingStamps::legs},
}};

constexpr const char* kImuOnCameraClock = "geoflow.stamps.imu_on_camera_clock";

template <typename Number>
std::optional<Number> number(const CustomData& data, const char* key) {
  const auto found = data.find(key);
  if (found == data.end()) {
    return std::nullopt;
  }
  const std::string& text = found->second;
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return value;
}

std::optional<double> positive(const CustomData& data, const char* key) {
  const auto value = number<double>(data, key);
  return value && *value > 0 && std::isfinite(*value) ? value : std::nullopt;
}

}  // namespace

Extras parse_extras(const CustomData& custom_data) {
  constexpr std::int64_t kLargestShiftNs = 10'000'000'000;
  Extras extras;
  extras.depth_unit_m = positive(custom_data, kDepthUnit);
  if (const auto name = custom_data.find(kDepthAlignment); name != custom_data.end()) {
    extras.depth_alignment = depth_alignment(name->second);
  }
  const auto shift = number<std::int64_t>(custom_data, kTimeshift);
  if (shift && *shift >= -kLargestShiftNs && *shift <= kLargestShiftNs) {
    extras.timeshift_cam_imu = Duration{*shift};
  }
  ImuNoise noise;
  bool whole = true;
  for (const auto& [key, member] : kNoise) {
    const auto value = positive(custom_data, key);
    whole = whole && value.has_value();
    noise.*member = value.value_or(0);
  }
  if (whole) {
    extras.imu_noise = noise;
  }
  for (const auto& [key, member] : kDeviceStamps) {
    if (const auto wrap = number<std::int64_t>(custom_data, key); wrap && *wrap >= 0) {
      extras.stamps.*member = {.domain = StampDomain::kDevice,
                               .wrap = *wrap > 0 ? std::optional{Duration{*wrap}} : std::nullopt};
    }
  }
  extras.stamps.imu.on_camera_clock = number<int>(custom_data, kImuOnCameraClock) == 1;
  return extras;
}

CustomData to_custom_data(const Extras& extras) {
  CustomData data;
  if (extras.depth_unit_m) {
    data[kDepthUnit] = fmt::format("{}", *extras.depth_unit_m);
  }
  if (extras.depth_alignment) {
    data[kDepthAlignment] = name_of(*extras.depth_alignment);
  }
  if (extras.timeshift_cam_imu) {
    data[kTimeshift] = fmt::format("{}", extras.timeshift_cam_imu->count());
  }
  if (extras.imu_noise) {
    for (const auto& [key, member] : kNoise) {
      data[key] = fmt::format("{}", (*extras.imu_noise).*member);
    }
  }
  for (const auto& [key, member] : kDeviceStamps) {
    const StampInfo& stamps = extras.stamps.*member;
    if (stamps.domain == StampDomain::kDevice) {
      data[key] = fmt::format("{}", stamps.wrap.value_or(Duration{}).count());
    }
  }
  if (extras.stamps.imu.on_camera_clock) {
    data[kImuOnCameraClock] = fmt::format("{}", 1);
  }
  return data;
}

}  // namespace geoflow::drivers::bag
