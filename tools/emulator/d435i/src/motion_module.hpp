#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {

/// The IMU behind the HID interface: an accelerometer (report 1) and a gyroscope (report 2), each
/// switched on and paced by its feature report. Axes are the chip's: a half turn about y from the
/// imu frame. Sources: librealsense's hid-types.h and hid-device.cpp, the kernel's hid-sensor
/// drivers.
class MotionModule {
 public:
  /// `wide`: 32-bit axes, reports of 38 bytes; else 16-bit ones and 32 bytes.
  explicit MotionModule(bool wide) noexcept : wide_{wide} {}

  /// A class request to the HID interface; none: STALL.
  [[nodiscard]] std::optional<Bytes> request(const SetupPacket& setup,
                                             std::span<const std::byte> out);

  /// Whether a sensor is switched on.
  [[nodiscard]] bool active() const noexcept;
  /// A sample felt at `device_us`, `t` on the world's time line: becomes up to two reports, as
  /// often as their sensors are to speak.
  void feel(const ImuSample& sample, std::uint64_t device_us, Duration t);
  /// The oldest report not yet fetched.
  [[nodiscard]] std::optional<Bytes> next_report();
  [[nodiscard]] bool has_report() const noexcept { return !reports_.empty(); }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }
  /// Off, and as after power-on.
  void reset();

 private:
  struct Sensor {
    std::uint8_t power = 0;
    std::uint16_t interval_ms = 0;
    std::uint16_t sensitivity = 0;
    std::optional<Duration> due{};
    std::uint8_t counter = 0;
    Bytes latest{};  ///< report
  };
  static constexpr std::size_t kSensors = 3;

  [[nodiscard]] Bytes feature(std::uint8_t report) const;
  [[nodiscard]] bool set_feature(std::uint8_t report, std::span<const std::byte> out);
  [[nodiscard]] Bytes encode(std::uint8_t id, const Vector3d& counts,
                             std::uint64_t device_us) const;
  void report(std::uint8_t id, const Vector3d& counts, std::uint64_t device_us);

  bool wide_;
  std::array<Sensor, kSensors> sensors_ = initial();
  std::deque<Bytes> reports_;
  std::uint8_t sent_ = 0;
  std::uint64_t dropped_ = 0;

  [[nodiscard]] static std::array<Sensor, kSensors> initial() noexcept;
};

}  // namespace geoflow::emulator
