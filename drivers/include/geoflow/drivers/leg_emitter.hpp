#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

/// The other end of the legs' drivers: says on a bus what a robot would, for emulation.
namespace geoflow::drivers {

/// One instant of a robot.
struct EmittedSample {
  LegSample legs;
  ImuSample body_imu;      ///< in the frame of the body's IMU; only DDS carries it
  Duration device_time{};  ///< on the robot's clock, >= 0; each later than the one before
};

/// Thread-bound.
class LegEmitter {
 public:
  LegEmitter() = default;
  LegEmitter(const LegEmitter&) = delete;
  LegEmitter& operator=(const LegEmitter&) = delete;
  virtual ~LegEmitter() = default;

  /// Says one sample. An error (kUnavailable) means that the interface is down or gone.
  [[nodiscard]] virtual Result<void> emit(const EmittedSample& sample) = 0;
};

struct CanEmitterOptions {
  std::string interface = "vcan0";
  std::filesystem::path dictionary{};  ///< a DBC file; empty: the program's
  bool fd = false;                     ///< CAN FD frames of the dictionary instead of classic ones
};

/// Legs on a CAN interface, a round of frames for each sample. The error says what is missing.
[[nodiscard]] Result<std::unique_ptr<LegEmitter>> open_can_emitter(
    const CanEmitterOptions& options);

/// LowState over DDS. The error says what is missing.
[[nodiscard]] Result<std::unique_ptr<LegEmitter>> open_dds_emitter(const DdsRobotOptions& options);

}  // namespace geoflow::drivers
