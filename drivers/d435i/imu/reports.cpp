#include "d435i/imu/reports.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

#include "fields.hpp"

namespace geoflow::drivers::d435i {
namespace {

constexpr std::size_t k16BitReportBytes = 32;
constexpr std::size_t k32BitReportBytes = 38;

constexpr double kStandardGravity_mps2 = 9.80665;
constexpr double kAccelCount_g = 1e-3;
constexpr double kGyroCount16Bit_deg = 0.1;
constexpr double kGyroCount32Bit_deg = 1e-4;
constexpr double kRadiansPerDegree = std::numbers::pi / 180;

bool is_known(std::uint8_t id) noexcept {
  return id == static_cast<std::uint8_t>(ImuSensor::kAccelerometer) ||
         id == static_cast<std::uint8_t>(ImuSensor::kGyroscope);
}

template <Field T>
std::array<std::int32_t, 3> take_axes(FieldReader& fields) noexcept {
  const auto axes = fields.take_array<T, 3>();
  return {axes[0], axes[1], axes[2]};
}

double count_in_si(const ImuReading& reading) noexcept {
  if (reading.sensor == ImuSensor::kAccelerometer) {
    return kAccelCount_g * kStandardGravity_mps2;
  }
  return kRadiansPerDegree *
         (reading.layout == ImuLayout::k16Bit ? kGyroCount16Bit_deg : kGyroCount32Bit_deg);
}

}  // namespace

Result<ImuReading> parse_input_report(std::span<const std::byte> report) {
  if (report.size() != k16BitReportBytes && report.size() != k32BitReportBytes) {
    return fail(ErrorCode::kUnsupported, "an IMU report of {} bytes; known are {} and {}",
                report.size(), k16BitReportBytes, k32BitReportBytes);
  }
  FieldReader fields{report};
  const auto id = fields.take<std::uint8_t>();
  if (!is_known(id)) {
    return fail(ErrorCode::kUnsupported, "an IMU report with the id {}", id);
  }
  fields.skip(1);  // state
  ImuReading reading{
      .sensor = ImuSensor{id},
      .layout = report.size() == k16BitReportBytes ? ImuLayout::k16Bit : ImuLayout::k32Bit};
  // Of its 64 bits only the lower half is on the clock of the video stamps.
  reading.t_device_us = static_cast<std::uint32_t>(fields.take<std::uint64_t>());
  reading.counts = reading.layout == ImuLayout::k16Bit ? take_axes<std::int16_t>(fields)
                                                       : take_axes<std::int32_t>(fields);
  return reading;
}

Vector3d to_si(const ImuReading& reading) noexcept {
  const Vector3d chip{static_cast<double>(reading.counts[0]),
                      static_cast<double>(reading.counts[1]),
                      static_cast<double>(reading.counts[2])};
  // How the chip is mounted in a D435i (librealsense, src/ds/d400/ds-calib-parsers.cpp).
  const Vector3d mounting{-1, 1, -1};
  return count_in_si(reading) * mounting.cwiseProduct(chip);
}

Result<ImuFeature> parse_feature_report(std::span<const std::byte> report) {
  FieldReader fields{report};
  const auto id = fields.take<std::uint8_t>();
  ImuFeature feature{.connection = fields.take<std::uint8_t>(),
                     .state = fields.take<std::uint8_t>(),
                     .power = fields.take<std::uint8_t>(),
                     .least_interval = fields.take<std::uint8_t>(),
                     .interval_ms = fields.take<std::uint16_t>(),
                     .sensitivity = fields.take<std::uint16_t>()};
  if (!fields.ok() || !is_known(id)) {
    return fail(ErrorCode::kInvalidData, "an IMU feature report of {} bytes with the id {}",
                report.size(), id);
  }
  feature.sensor = ImuSensor{id};
  return feature;
}

std::vector<std::byte> encode_feature_report(const ImuFeature& feature) {
  FieldWriter report;
  report.put(static_cast<std::uint8_t>(feature.sensor))
      .put(feature.connection)
      .put(feature.state)
      .put(feature.power)
      .put(feature.least_interval)
      .put(feature.interval_ms)
      .put(feature.sensitivity);
  return std::move(report).take();
}

Result<int> rate_code(int rate_hz) {
  struct Rate {
    int hz;
    int code;
  };
  // BMI055: 63, 250 and 200, 400; BMI085 and BMI088: 100, 200 and 200, 400
  // (librealsense, src/ds/ds-motion-common.cpp).
  constexpr std::array<Rate, 5> kRates{{{63, 1}, {100, 1}, {200, 2}, {250, 3}, {400, 4}}};
  const auto* const found = std::ranges::find(kRates, rate_hz, &Rate::hz);
  if (found == kRates.end()) {
    return fail(ErrorCode::kInvalidArgument,
                "an IMU rate of {} Hz; there are 63, 100, 200, 250 and 400", rate_hz);
  }
  return found->code;
}

std::uint16_t interval_of(int code) noexcept {
  constexpr int kSecond_ms = 1000;
  return static_cast<std::uint16_t>(code > 0 ? kSecond_ms / code : 0);
}

}  // namespace geoflow::drivers::d435i
