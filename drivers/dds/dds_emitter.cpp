#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/drivers/leg_emitter.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

#include "dds/channel.hpp"
#include "dds/low_state.hpp"

namespace geoflow::drivers {
namespace {

// What a real Go2 sends in these (unitree_sdk2).
constexpr std::array<std::uint8_t, 2> kHead{0xFE, 0xEF};
constexpr std::uint8_t kLowLevel = 0xFF;
constexpr std::uint8_t kServoMode = 1;

std::array<float, 3> floats(const Vector3d& vector) {
  const Eigen::Vector3f rounded = vector.cast<float>();
  return {rounded.x(), rounded.y(), rounded.z()};
}

std::int16_t counts(float force) {
  using Limits = std::numeric_limits<std::int16_t>;
  return static_cast<std::int16_t>(std::clamp(
      std::nearbyint(force), static_cast<float>(Limits::min()), static_cast<float>(Limits::max())));
}

dds::LowState low_state(const EmittedSample& sample) {
  dds::LowState state{.head = kHead, .level_flag = kLowLevel};
  state.imu_state.quaternion = {1, 0, 0, 0};
  state.imu_state.gyroscope = floats(sample.body_imu.gyro_radps);
  state.imu_state.accelerometer = floats(sample.body_imu.accel_mps2);
  for (std::size_t i = 0; i < sample.legs.joints.size(); ++i) {
    const JointState& joint = sample.legs.joints[i];
    state.motor_state[i] = {.mode = kServoMode,
                            .q = static_cast<float>(joint.q_rad),
                            .dq = static_cast<float>(joint.dq_radps),
                            .tau_est = static_cast<float>(joint.tau_nm)};
  }
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    state.foot_force[leg] = counts(sample.legs.foot_force[leg]);
  }
  state.tick = static_cast<std::uint32_t>(
      std::chrono::round<std::chrono::milliseconds>(sample.device_time).count());
  state.crc = dds::checksum(state);
  return state;
}

class DdsEmitter final : public LegEmitter {
 public:
  explicit DdsEmitter(std::unique_ptr<dds::Publisher> publisher)
      : publisher_{std::move(publisher)} {}

  Result<void> emit(const EmittedSample& sample) override {
    return publisher_->write(low_state(sample));
  }

 private:
  std::unique_ptr<dds::Publisher> publisher_;
};

}  // namespace

Result<std::unique_ptr<LegEmitter>> open_dds_emitter(const DdsRobotOptions& options) {
  auto publisher = dds::make_publisher({.topic = options.topic,
                                        .domain = static_cast<std::uint32_t>(options.domain),
                                        .interface = options.interface});
  if (!publisher) {
    return tl::unexpected{std::move(publisher.error())};
  }
  return std::make_unique<DdsEmitter>(*std::move(publisher));
}

}  // namespace geoflow::drivers
