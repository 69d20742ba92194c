#include "src/motion_module.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/pace.hpp"

namespace geoflow::emulator {
namespace {

enum HidRequest : std::uint8_t { kGetReport = 0x01, kSetReport = 0x09, kSetIdle = 0x0a };
enum ReportType : std::uint8_t { kInput = 1, kFeature = 3 };
enum PowerState : std::uint8_t { kFull = 2, kOff = 6 };

constexpr std::uint8_t kAccelerometer = 1;
constexpr std::uint8_t kGyroscope = 2;
constexpr std::uint8_t kCustom = 3;
constexpr std::size_t kFeatureSize = 9;
constexpr std::size_t kReportLimit = 64;  // not yet fetched

// Resolutions and ranges. Before firmware 5.16 the gyroscope counts tenths of a degree per second.
constexpr double kMps2PerG = 9.80665;
constexpr double kAccelPerCount = 0.001 * kMps2PerG;
constexpr double kRadiansPerDegree = std::numbers::pi / 180.0;
constexpr double kGyroDegreesPerCount = 0.1;
constexpr double kWideGyroDegreesPerCount = 0.0001;
constexpr double kAccelRange = 4.0 * kMps2PerG;
constexpr double kGyroRange = 1000.0 * kRadiansPerDegree;

/// The chip's axes from the imu frame's, and back.
Vector3d chip_axes(const Vector3d& v) {
  return {-v.x(), v.y(), -v.z()};
}

/// How often a sensor speaks at a report interval: the firmware takes 1000 ms over a code from 1 to
/// 4 for one of the BMI085's rates, and other intervals as they are.
double rate_hz(std::uint8_t report, std::uint16_t interval_ms) {
  constexpr double kMillisecondsPerSecond = 1000;
  constexpr std::array<double, 4> kAccelRates{100, 200, 250, 400};
  constexpr std::array<double, 4> kGyroRates{200, 200, 400, 400};
  if (interval_ms == 0) {
    return 0;
  }
  const double code = kMillisecondsPerSecond / interval_ms;
  const auto index = static_cast<std::size_t>(std::lround(code));
  if (index < 1 || index > kAccelRates.size()) {
    return code;
  }
  return (report == kAccelerometer ? kAccelRates : kGyroRates)[index - 1];
}

}  // namespace

std::array<MotionModule::Sensor, MotionModule::kSensors> MotionModule::initial() noexcept {
  constexpr std::uint16_t kIdleAccelerometerMs = 100;
  return {Sensor{.power = kOff, .interval_ms = kIdleAccelerometerMs}, Sensor{.power = kOff},
          Sensor{.power = kOff}};
}

void MotionModule::reset() {
  sensors_ = initial();
  reports_.clear();
}

bool MotionModule::active() const noexcept {
  return sensors_[kAccelerometer - 1].power == kFull || sensors_[kGyroscope - 1].power == kFull;
}

Bytes MotionModule::feature(std::uint8_t report) const {
  constexpr unsigned kIntegrated = 1;
  constexpr unsigned kReady = 2;
  constexpr unsigned kShortestMs = 250;
  const Sensor& sensor = sensors_[report - 1U];
  return ByteWriter{}
      .put(report)
      .u8(kIntegrated)
      .u8(kReady)
      .put(sensor.power)
      .u8(kShortestMs)
      .put(sensor.interval_ms)
      .put(sensor.sensitivity)
      .take();
}

bool MotionModule::set_feature(std::uint8_t report, std::span<const std::byte> out) {
  if (out.size() != kFeatureSize || std::to_integer<std::uint8_t>(out[0]) != report) {
    return false;
  }
  const auto u16_at = [&](std::size_t offset) {
    constexpr unsigned kByteBits = 8;
    return static_cast<std::uint16_t>(std::to_integer<unsigned>(out[offset]) |
                                      (std::to_integer<unsigned>(out[offset + 1]) << kByteBits));
  };
  constexpr std::size_t kPowerAt = 3;
  constexpr std::size_t kIntervalAt = 5;
  constexpr std::size_t kSensitivityAt = 7;
  const auto power = std::to_integer<std::uint8_t>(out[kPowerAt]);
  Sensor& sensor = sensors_[report - 1U];
  if (power > kOff) {
    return false;
  }
  // A host that has not read the report yet, as Linux, knows no state and says 0.
  sensor.power = power == 0 ? sensor.power : power;
  sensor.interval_ms = u16_at(kIntervalAt);
  sensor.sensitivity = u16_at(kSensitivityAt);
  sensor.due.reset();
  return true;
}

std::optional<Bytes> MotionModule::request(const SetupPacket& setup,
                                           std::span<const std::byte> out) {
  constexpr unsigned kByteBits = 8;
  const auto report = static_cast<std::uint8_t>(setup.value);
  const auto type = static_cast<std::uint8_t>(setup.value >> kByteBits);
  if (setup.request == kSetIdle && !setup.is_in()) {
    return Bytes{};
  }
  if (report < 1 || report > kSensors) {
    return std::nullopt;
  }
  if (setup.request == kGetReport && setup.is_in() && type == kFeature) {
    return feature(report);
  }
  if (setup.request == kGetReport && setup.is_in() && type == kInput) {
    const Bytes& latest = sensors_[report - 1U].latest;
    return latest.empty() ? encode(report, Vector3d::Zero(), 0) : latest;
  }
  if (setup.request == kSetReport && !setup.is_in() && type == kFeature &&
      set_feature(report, out)) {
    return Bytes{};
  }
  return std::nullopt;
}

void MotionModule::feel(const ImuSample& sample, std::uint64_t device_us, Duration t) {
  if (!sample.accel_mps2.allFinite() || !sample.gyro_radps.allFinite()) {
    return;  // a recording's fault that no chip can report
  }
  const double gyro_per_count =
      (wide_ ? kWideGyroDegreesPerCount : kGyroDegreesPerCount) * kRadiansPerDegree;
  const auto counts = [](const Vector3d& value, double range, double per_count) {
    const Vector3d limited = value.cwiseMax(-range).cwiseMin(range) / per_count;
    return Vector3d{chip_axes(limited).array().round()};
  };
  const std::array<Vector3d, 2> readings{counts(sample.accel_mps2, kAccelRange, kAccelPerCount),
                                         counts(sample.gyro_radps, kGyroRange, gyro_per_count)};
  for (std::size_t i = 0; i < readings.size(); ++i) {
    Sensor& sensor = sensors_[i];
    const auto id = static_cast<std::uint8_t>(i + 1);
    const double rate = sensor.power == kFull ? rate_hz(id, sensor.interval_ms) : 0.0;
    if (rate > 0 && is_due(sensor.due, t, from_seconds(1.0 / rate))) {
      report(id, readings[i], device_us);
    }
  }
}

Bytes MotionModule::encode(std::uint8_t id, const Vector3d& counts, std::uint64_t device_us) const {
  constexpr unsigned kReady = 2;
  constexpr std::size_t kNotSaid = 14;  // custom values 1 to 5
  ByteWriter to;
  to.put(id).u8(kReady).put(device_us);
  for (Eigen::Index axis = 0; axis < 3 && id != kCustom; ++axis) {
    const auto count = static_cast<std::int32_t>(counts[axis]);
    if (wide_) {
      to.put(count);
    } else {
      to.put(static_cast<std::int16_t>(count));
    }
  }
  return to.pad_to(to.size() + kNotSaid).put(sensors_[id - 1U].counter).put(sent_).take();
}

void MotionModule::report(std::uint8_t id, const Vector3d& counts, std::uint64_t device_us) {
  Sensor& sensor = sensors_[id - 1U];
  sensor.latest = encode(id, counts, device_us);
  ++sensor.counter;
  ++sent_;
  if (reports_.size() == kReportLimit) {
    reports_.pop_front();
    ++dropped_;
  }
  reports_.push_back(sensor.latest);
}

std::optional<Bytes> MotionModule::next_report() {
  if (reports_.empty()) {
    return std::nullopt;
  }
  Bytes report = std::move(reports_.front());
  reports_.pop_front();
  return report;
}

}  // namespace geoflow::emulator
