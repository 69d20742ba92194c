#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

/// The IMU as its HID interface speaks. The D435i's two layouts of an input report, told apart by
/// their length: 32 bytes with 16-bit axes (firmware before 5.16), 38 bytes with 32-bit axes.
///
/// Sources: HID Usage Tables 1.5, 20 (sensors); librealsense, src/hid/hid-types.h.
namespace geoflow::drivers::d435i {

/// Which of the chip's two sensors; the value is its report id.
enum class ImuSensor : std::uint8_t { kAccelerometer = 1, kGyroscope = 2 };

/// The firmware's number formats.
enum class ImuLayout : std::uint8_t {
  k16Bit,  ///< before 5.16: gyroscope counts of 0.1 deg/s
  k32Bit,  ///< from 5.16 on: gyroscope counts of 0.0001 deg/s
};

/// One reading: counts along the chip's own axes.
struct ImuReading {
  ImuSensor sensor = ImuSensor::kAccelerometer;
  ImuLayout layout = ImuLayout::k16Bit;
  std::uint32_t t_device_us = 0;  ///< the camera's clock: that of the video stamps
  std::array<std::int32_t, 3> counts{};
};

/// Reads one input report. kUnsupported where it is of neither length, or of neither sensor (the
/// camera's third report has temperatures). Pure.
[[nodiscard]] Result<ImuReading> parse_input_report(std::span<const std::byte> report);

/// The reading in m/s^2 or rad/s, in the depth camera's axes (x right, y down, z forward).
[[nodiscard]] Vector3d to_si(const ImuReading& reading) noexcept;

/// A sensor's settings, as its feature report has them.
struct ImuFeature {
  ImuSensor sensor = ImuSensor::kAccelerometer;
  std::uint8_t connection = 0;
  std::uint8_t state = 0;
  std::uint8_t power = 0;  ///< kPowerFull or kPowerOff
  std::uint8_t least_interval = 0;
  std::uint16_t interval_ms = 0;  ///< stands for a rate: see interval_of()
  std::uint16_t sensitivity = 0;
};
inline constexpr std::uint8_t kPowerFull = 2;  ///< D0
inline constexpr std::uint8_t kPowerOff = 6;   ///< D4
inline constexpr std::size_t kFeatureBytes = 9;

/// kInvalidData where the report is short or of an unknown sensor. Pure.
[[nodiscard]] Result<ImuFeature> parse_feature_report(std::span<const std::byte> report);
[[nodiscard]] std::vector<std::byte> encode_feature_report(const ImuFeature& feature);

/// The number by which a sensor is told its rate: what the firmware calls a frequency [Hz] is a
/// step of its scale. 63 -> 1, 100 -> 1, 200 -> 2, 250 -> 3, 400 -> 4; kInvalidArgument of any
/// other rate.
[[nodiscard]] Result<int> rate_code(int rate_hz);

/// What an interval of the feature report is for a code: 1000 ms / code.
[[nodiscard]] std::uint16_t interval_of(int code) noexcept;

}  // namespace geoflow::drivers::d435i
