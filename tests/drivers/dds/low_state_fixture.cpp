#include "dds/low_state_fixture.hpp"

#include <cstddef>
#include <cstdint>

#include "dds/low_state.hpp"

namespace geoflow::drivers::dds::tests {

LowState low_state(std::uint32_t number) {
  LowState state{.head = {0xFE, 0xEF}, .level_flag = 0xFF};
  const float step = 0.001F * static_cast<float>(number % 1000);
  state.sn = {1, 2};
  state.version = {3, 4};
  state.bandwidth = 5;
  state.imu_state = {.quaternion = {1, 0, 0, 0},
                     .gyroscope = {0.1F + step, -0.2F, 0.3F},
                     .accelerometer = {0.5F, -0.25F, 9.81F + step},
                     .temperature = 61};
  for (std::size_t i = 0; i < LowState::kMotors; ++i) {
    const auto joint = static_cast<float>(i);
    state.motor_state[i] = {.mode = static_cast<std::uint8_t>(i < 12 ? 1 : 0),
                            .q = 0.1F * joint + step,
                            .dq = joint - step,
                            .tau_est = 2 * joint + step,
                            .temperature = static_cast<std::uint8_t>(30 + i),
                            .lost = 7};
  }
  state.bms_state = {.version_high = 1, .soc = 80, .current = -1500, .cycle = 12};
  for (std::size_t i = 0; i < BmsState::kCells; ++i) {
    state.bms_state.cell_vol[i] = static_cast<std::uint16_t>(4000 + i);
  }
  state.foot_force = {20, 21, -22, 23};
  state.tick = 2 * number;
  state.wireless_remote[39] = 0x5A;
  state.bit_flag = 36;
  state.power_v = 29.5F;
  state.fan_frequency = {1, 2, 3, 4};
  state.crc = checksum(state);
  return state;
}

}  // namespace geoflow::drivers::dds::tests
