#pragma once

#include <optional>
#include <string_view>
#include <utility>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/line_file.hpp"

namespace geoflow::drivers::openloris {

/// One line `stamp[s] x y z`.
struct StampedVector {
  HostTime t;
  Vector3d value;
};
[[nodiscard]] Result<StampedVector> parse_vector(std::string_view line);

/// Makes one IMU of an accelerometer and a gyroscope that are stamped apart: samples at the
/// gyroscope's stamps, the acceleration interpolated linearly between its two neighbours. Where
/// these do not exist, or lie more than 0.1 s apart, there is no sample. Both files in order of
/// time; streamed. Thread-bound.
class ImuMerge {
 public:
  ImuMerge(text::LineFile accelerometer, text::LineFile gyroscope)
      : accelerometer_{std::move(accelerometer)}, gyroscope_{std::move(gyroscope)} {}

  /// The next sample; none at the end. An Error names the bad line; the next call goes on behind
  /// it.
  [[nodiscard]] Result<std::optional<Arrival<ImuClock, ImuSample>>> next();

 private:
  [[nodiscard]] static Result<std::optional<StampedVector>> read(text::LineFile& file);
  /// Reads on until `after_` is at or behind `t`.
  [[nodiscard]] Result<void> advance(HostTime t);

  text::LineFile accelerometer_;
  text::LineFile gyroscope_;
  std::optional<StampedVector> before_;
  std::optional<StampedVector> after_;
  std::optional<StampedVector> gyro_;  ///< read, but not yet answered
  bool accelerometer_ended_ = false;
};

}  // namespace geoflow::drivers::openloris
