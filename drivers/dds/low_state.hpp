#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

/// Unitree's message of the Go2's low level, `unitree_go::msg::dds_::LowState_` (LowState.idl), in
/// wire order. Plain values as the robot sends them.
namespace geoflow::drivers::dds {

struct ImuState {
  std::array<float, 4> quaternion{};     ///< w, x, y, z
  std::array<float, 3> gyroscope{};      ///< [rad/s]
  std::array<float, 3> accelerometer{};  ///< [m/s^2]
  std::array<float, 3> rpy{};            ///< [rad]
  std::uint8_t temperature = 0;

  static constexpr auto fields(auto& s) {
    return std::tie(s.quaternion, s.gyroscope, s.accelerometer, s.rpy, s.temperature);
  }
};

struct MotorState {
  std::uint8_t mode = 0;
  float q = 0;        ///< [rad]
  float dq = 0;       ///< [rad/s]
  float ddq = 0;      ///< [rad/s^2]
  float tau_est = 0;  ///< [Nm]
  float q_raw = 0;
  float dq_raw = 0;
  float ddq_raw = 0;
  std::uint8_t temperature = 0;
  std::uint32_t lost = 0;
  std::array<std::uint32_t, 2> reserve{};

  static constexpr auto fields(auto& s) {
    return std::tie(s.mode, s.q, s.dq, s.ddq, s.tau_est, s.q_raw, s.dq_raw, s.ddq_raw,
                    s.temperature, s.lost, s.reserve);
  }
};

struct BmsState {
  static constexpr std::size_t kCells = 15;

  std::uint8_t version_high = 0;
  std::uint8_t version_low = 0;
  std::uint8_t status = 0;
  std::uint8_t soc = 0;
  std::int32_t current = 0;
  std::uint16_t cycle = 0;
  std::array<std::uint8_t, 2> bq_ntc{};
  std::array<std::uint8_t, 2> mcu_ntc{};
  std::array<std::uint16_t, kCells> cell_vol{};

  static constexpr auto fields(auto& s) {
    return std::tie(s.version_high, s.version_low, s.status, s.soc, s.current, s.cycle, s.bq_ntc,
                    s.mcu_ntc, s.cell_vol);
  }
};

struct LowState {
  static constexpr std::size_t kMotors = 20;  ///< the first twelve are the legs', in SDK order
  static constexpr std::size_t kRemoteBytes = 40;

  std::array<std::uint8_t, 2> head{};
  std::uint8_t level_flag = 0;
  std::uint8_t frame_reserve = 0;
  std::array<std::uint32_t, 2> sn{};
  std::array<std::uint32_t, 2> version{};
  std::uint16_t bandwidth = 0;
  ImuState imu_state{};
  std::array<MotorState, kMotors> motor_state{};
  BmsState bms_state{};
  std::array<std::int16_t, 4> foot_force{};  ///< counts; FR, FL, RR, RL
  std::array<std::int16_t, 4> foot_force_est{};
  std::uint32_t tick = 0;  ///< the robot's time [ms]
  std::array<std::uint8_t, kRemoteBytes> wireless_remote{};
  std::uint8_t bit_flag = 0;
  float adc_reel = 0;
  std::uint8_t temperature_ntc1 = 0;
  std::uint8_t temperature_ntc2 = 0;
  float power_v = 0;
  float power_a = 0;
  std::array<std::uint16_t, 4> fan_frequency{};
  std::uint32_t reserve = 0;
  std::uint32_t crc = 0;

  static constexpr auto fields(auto& s) {
    return std::tie(s.head, s.level_flag, s.frame_reserve, s.sn, s.version, s.bandwidth,
                    s.imu_state, s.motor_state, s.bms_state, s.foot_force, s.foot_force_est, s.tick,
                    s.wireless_remote, s.bit_flag, s.adc_reel, s.temperature_ntc1,
                    s.temperature_ntc2, s.power_v, s.power_a, s.fan_frequency, s.reserve, s.crc);
  }
};

/// Reads one message in CDR. An error names the byte at which it does not fit, or how much is left
/// over. Pure.
[[nodiscard]] Result<LowState> decode(std::span<const std::byte> cdr);
/// Writes it. Pure.
[[nodiscard]] std::vector<std::byte> encode(const LowState& state);

inline constexpr std::size_t kMemoryBytes = 1180;

/// The message as a C struct on a little-endian machine, its padding zero: over this the robot's
/// checksum goes. Pure.
[[nodiscard]] std::array<std::byte, kMemoryBytes> memory_image(const LowState& state);

/// The checksum that `crc` should have: CRC-32 (polynomial 0x04C11DB7, first 0xFFFFFFFF, most
/// significant bit first, not inverted) over the memory image's words before it. A sender that does
/// not zero its padding sends another. Source: unitree_sdk2, crc32_core. Pure.
[[nodiscard]] std::uint32_t checksum(const LowState& state);

/// The legs' part; an error if a value is not finite. Pure.
[[nodiscard]] Result<LegSample> legs_of(const LowState& state);
/// The body IMU's part, in the robot's own IMU frame (x forward, z up); an error if a value is not
/// finite. Pure.
[[nodiscard]] Result<ImuSample> imu_of(const LowState& state);

}  // namespace geoflow::drivers::dds
