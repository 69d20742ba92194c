#pragma once

#include <optional>
#include <variant>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::emulator {

/// Something that the emulated camera's sensors saw or felt.
struct WorldSample {
  Duration t{};  ///< when: the middle of an exposure, an IMU's instant; since the world's start
  Duration
      t_sent{};  ///< when the camera has it ready to send; never decreases from sample to sample
  Duration t_sent_recorded{};  ///< t_sent on the time line of the recording that it is from
  std::variant<ColorFrame, DepthFrame, ImuSample> sample{};
  /// The world took its time before this one (to begin again): it is not late, but all that follows
  /// is later.
  bool resumes = false;
};

/// What there is before the emulated camera. Thread-bound.
class World {
 public:
  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  virtual ~World() = default;

  /// Of the images and IMU samples that next() gives. Depth lies on the colour image's pixels.
  [[nodiscard]] virtual const Calibration& calibration() const = 0;

  /// The next sample in order of t_sent; none: the world has ended. An Error concerns one sample;
  /// the call after it goes on behind it.
  [[nodiscard]] virtual Result<std::optional<WorldSample>> next() = 0;
};

}  // namespace geoflow::emulator
