#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

#include "geoflow/drivers/leg_emitter.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

/// Where emulated legs get what they say.
namespace geoflow::tools {

/// Gets each sample when it is its time; false ends the run.
using SampleHandler = std::function<bool(const drivers::EmittedSample&)>;

/// The legs of a recording at its own pace. `shift` is what is added to the recording's time to get
/// the host's; samples whose time is over when it begins are left out. None: it begins now. The
/// body's IMU says what the recording's says, turned
/// to the robot's axes where the calibration tells how the camera is mounted, else zero; that it is
/// at another place is not taken into account. `offset` is added to device times, which begin at 0.
/// An error if it cannot be opened or has no legs.
[[nodiscard]] Result<void> play_recorded_legs(const std::filesystem::path& recording,
                                              std::optional<Duration> shift, Duration offset,
                                              const SampleHandler& handler);

/// The legs of a simulated Go2 that walks to and fro on a straight line, with the sensors' usual
/// errors, and an ideal body IMU. Deterministic but for its pace.
struct SimulatedLegs {
  std::uint64_t seed = 1;
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  double duration_s = 60;
};
[[nodiscard]] Result<void> play_simulated_legs(const SimulatedLegs& options, Duration offset,
                                               const SampleHandler& handler);

}  // namespace geoflow::tools
