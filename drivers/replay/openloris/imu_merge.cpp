#include "replay/openloris/imu_merge.hpp"

#include <chrono>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/line_file.hpp"
#include "replay/text.hpp"

namespace geoflow::drivers::openloris {
namespace {

constexpr Duration kWidestGap = std::chrono::milliseconds{100};

std::optional<Vector3d> interpolate(const StampedVector& before, const StampedVector& after,
                                    HostTime t) {
  const Duration gap = after.t - before.t;
  if (gap > kWidestGap || t < before.t) {
    return std::nullopt;
  }
  if (gap <= Duration{}) {
    return after.value;
  }
  const double ratio = to_seconds(t - before.t) / to_seconds(gap);
  return before.value + ratio * (after.value - before.value);
}

}  // namespace

Result<StampedVector> parse_vector(std::string_view line) {
  constexpr std::size_t kFields = 4;
  const auto fields = text::split_blanks(line);
  if (fields.size() != kFields) {
    return fail(ErrorCode::kInvalidData, "{} fields where 'seconds x y z' is expected",
                fields.size());
  }
  const auto t = text::parse_seconds(fields[0]);
  if (!t) {
    return fail(ErrorCode::kInvalidData, "'{}' is not a time in seconds", fields[0]);
  }
  StampedVector parsed{.t = HostTime{*t}, .value = Vector3d::Zero()};
  for (std::size_t i = 1; i < kFields; ++i) {
    const auto value = text::parse_number(fields[i]);
    if (!value) {
      return fail(ErrorCode::kInvalidData, "'{}' is not a number", fields[i]);
    }
    parsed.value[static_cast<Eigen::Index>(i) - 1] = *value;
  }
  return parsed;
}

Result<std::optional<StampedVector>> ImuMerge::read(text::LineFile& file) {
  auto line = file.next();
  if (!line) {
    return tl::unexpected{std::move(line.error())};
  }
  const std::optional<text::Line>& found = *line;
  if (!found) {
    return std::nullopt;
  }
  auto parsed = parse_vector(found->text);
  if (!parsed) {
    return tl::unexpected{std::move(parsed.error()).in(file.where())};
  }
  return *parsed;
}

Result<void> ImuMerge::advance(HostTime t) {
  while (!accelerometer_ended_ && (!after_ || after_->t < t)) {
    auto read_on = read(accelerometer_);
    if (!read_on) {
      return tl::unexpected{std::move(read_on.error())};
    }
    if (*read_on) {
      before_ = std::exchange(after_, *read_on);
    } else {
      accelerometer_ended_ = true;
    }
  }
  return {};
}

Result<std::optional<Arrival<ImuClock, ImuSample>>> ImuMerge::next() {
  while (true) {
    if (!gyro_) {
      auto gyro = read(gyroscope_);
      if (!gyro) {
        return tl::unexpected{std::move(gyro.error())};
      }
      gyro_ = *gyro;
    }
    if (!gyro_) {
      return std::nullopt;
    }
    if (auto advanced = advance(gyro_->t); !advanced) {
      return tl::unexpected{std::move(advanced.error())};
    }
    const StampedVector gyro = *gyro_;
    gyro_.reset();
    if (!after_ || after_->t < gyro.t) {
      continue;
    }
    if (const auto accel = interpolate(before_.value_or(*after_), *after_, gyro.t)) {
      return Arrival<ImuClock, ImuSample>{
          .t_device = DeviceTime<ImuClock>{gyro.t.time_since_epoch()},
          .t_arrival = gyro.t,
          .sample = {.accel_mps2 = *accel, .gyro_radps = gyro.value}};
    }
  }
}

}  // namespace geoflow::drivers::openloris
