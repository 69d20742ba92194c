#include "replay/calibration/kalibr.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/calibration/yaml.hpp"

namespace geoflow::drivers::kalibr {
namespace {

using yaml::Entry;

constexpr double kLargestSide = 65535;
constexpr double kLongestTimeshiftS = 3600;
constexpr std::size_t kIntrinsicCount = 4;

/// Stores `value` in `target` or passes the error on.
template <typename T, typename Target>
Result<void> store(Result<T> value, Target& target) {
  if (!value) {
    return tl::unexpected{std::move(value.error())};
  }
  target = *std::move(value);
  return {};
}

Result<void> ignore() {
  return {};
}

Result<void> read_intrinsics(const Entry& entry, CameraIntrinsics& camera) {
  constexpr std::array<std::size_t, 1> kSizes = {kIntrinsicCount};
  const auto values = yaml::numbers(entry, kSizes);
  if (!values) {
    return tl::unexpected{values.error()};
  }
  if ((*values)[0] <= 0 || (*values)[1] <= 0) {
    return tl::unexpected{entry.error("focal lengths must be positive")};
  }
  camera.fx = (*values)[0];
  camera.fy = (*values)[1];
  camera.cx = (*values)[2];
  camera.cy = (*values)[3];
  return {};
}

Result<void> read_resolution(const Entry& entry, CameraIntrinsics& camera) {
  constexpr std::array<std::size_t, 1> kSizes = {2};
  const auto values = yaml::numbers(entry, kSizes);
  if (!values) {
    return tl::unexpected{values.error()};
  }
  const bool fits = std::ranges::all_of(*values, [](double side) {
    return side >= 1 && side <= kLargestSide && std::floor(side) == side;
  });
  if (!fits) {
    return tl::unexpected{entry.error("width and height must be whole numbers from 1 to 65535")};
  }
  camera.width = static_cast<int>((*values)[0]);
  camera.height = static_cast<int>((*values)[1]);
  return {};
}

Result<void> read_distortion_model(const Entry& entry, CameraIntrinsics& camera) {
  const auto name = yaml::text(entry);
  if (!name) {
    return tl::unexpected{name.error()};
  }
  if (*name == "radtan") {
    camera.model = DistortionModel::kRadtan;
  } else if (*name == "equidistant") {
    camera.model = DistortionModel::kEquidistant;
  } else if (*name == "none") {
    camera.model = DistortionModel::kNone;
  } else {
    return tl::unexpected{
        entry.error(fmt::format("'{}' is none of radtan, equidistant, none", *name))};
  }
  return {};
}

Result<void> read_distortion(const Entry& entry, CameraIntrinsics& camera) {
  constexpr std::array<std::size_t, 3> kSizes = {0, 4, 5};
  const auto values = yaml::numbers(entry, kSizes);
  if (!values) {
    return tl::unexpected{values.error()};
  }
  camera.distortion.fill(0);
  std::ranges::copy(*values, camera.distortion.begin());
  return {};
}

Result<void> read_timeshift(const Entry& entry, Duration& timeshift) {
  const auto seconds = yaml::number(entry);
  if (!seconds) {
    return tl::unexpected{seconds.error()};
  }
  if (std::abs(*seconds) > kLongestTimeshiftS) {
    return tl::unexpected{entry.error(fmt::format("{} s is not a plausible time shift", *seconds))};
  }
  timeshift = from_seconds(*seconds);
  return {};
}

Result<void> read_camera_model(const Entry& entry) {
  const auto name = yaml::text(entry);
  if (!name) {
    return tl::unexpected{name.error()};
  }
  if (*name != "pinhole") {
    return tl::unexpected{entry.error(fmt::format("'{}' is not supported, only pinhole", *name))};
  }
  return {};
}

Result<void> read_camera_key(const Entry& entry, std::string_view key, Calibration& calibration) {
  if (key == "camera_model") {
    return read_camera_model(entry);
  }
  if (key == "intrinsics") {
    return read_intrinsics(entry, calibration.camera);
  }
  if (key == "distortion_model") {
    return read_distortion_model(entry, calibration.camera);
  }
  if (key == "distortion_coeffs") {
    return read_distortion(entry, calibration.camera);
  }
  if (key == "resolution") {
    return read_resolution(entry, calibration.camera);
  }
  if (key == "T_cam_imu") {
    return store(yaml::transform(entry), calibration.T_cam_imu);
  }
  if (key == "timeshift_cam_imu") {
    return read_timeshift(entry, calibration.timeshift_cam_imu);
  }
  if (key == "rostopic" || key == "cam_overlaps" || key == "T_cn_cnm1") {
    return ignore();
  }
  return tl::unexpected{entry.error("an unknown key")};
}

/// What a camera must have said by its end, and its plain form.
Result<void> finish_camera(const Entry& entry, CameraIntrinsics& camera) {
  if (camera.fx == 0) {
    return tl::unexpected{entry.error("intrinsics is missing: [fx, fy, cx, cy]")};
  }
  if (camera.width == 0) {
    return tl::unexpected{entry.error("resolution is missing: [width, height]")};
  }
  const bool straight =
      std::ranges::all_of(camera.distortion, [](double value) { return value == 0; });
  if (!straight && camera.model == DistortionModel::kNone) {
    return tl::unexpected{
        entry.error("distortion_coeffs without a distortion_model that uses them")};
  }
  if (camera.model == DistortionModel::kEquidistant && camera.distortion.back() != 0) {
    return tl::unexpected{entry.error("distortion_coeffs: equidistant has 4 numbers")};
  }
  // Zero coefficients of the plumb-bob model bend nothing; an equidistant lens bends even with
  // zeros.
  if (straight && camera.model == DistortionModel::kRadtan) {
    camera.model = DistortionModel::kNone;
  }
  return {};
}

Result<void> read_camera(const Entry& entry, Calibration& calibration) {
  auto read = yaml::for_each(entry, [&](const Entry& value, std::string_view key) {
    return read_camera_key(value, key, calibration);
  });
  return read ? finish_camera(entry, calibration.camera) : read;
}

bool is_further_camera(std::string_view key) {
  constexpr std::string_view kPrefix = "cam";
  return key.starts_with(kPrefix) && key.size() > kPrefix.size() &&
         key.find_first_not_of("0123456789", kPrefix.size()) == std::string_view::npos;
}

Result<void> read_depth_alignment(const Entry& entry, DepthAlignment& alignment) {
  const auto name = yaml::text(entry);
  if (!name) {
    return tl::unexpected{name.error()};
  }
  const auto known = depth_alignment(*name);
  if (!known) {
    return tl::unexpected{entry.error("expected exact or nearest_touching, found " + *name)};
  }
  alignment = *known;
  return {};
}

Result<void> read_top_key(const Entry& entry, std::string_view key, Calibration& calibration) {
  if (key == "cam0") {
    return read_camera(entry, calibration);
  }
  if (key == "T_base_cam") {
    return store(yaml::transform(entry), calibration.T_base_cam);
  }
  if (key == "depth_factor") {
    return store(yaml::positive(entry).map([](double counts_per_m) { return 1 / counts_per_m; }),
                 calibration.depth_unit_m);
  }
  if (key == "depth_alignment") {
    return read_depth_alignment(entry, calibration.depth_alignment);
  }
  if (key == "serial") {
    return store(yaml::text(entry), calibration.serial);
  }
  if (is_further_camera(key)) {
    return ignore();
  }
  return tl::unexpected{entry.error("an unknown key")};
}

Result<void> read_imu_key(const Entry& entry, std::string_view key, ImuNoise& noise) {
  if (key == "accelerometer_noise_density") {
    return store(yaml::positive(entry), noise.accel_noise_density);
  }
  if (key == "accelerometer_random_walk") {
    return store(yaml::positive(entry), noise.accel_random_walk);
  }
  if (key == "gyroscope_noise_density") {
    return store(yaml::positive(entry), noise.gyro_noise_density);
  }
  if (key == "gyroscope_random_walk") {
    return store(yaml::positive(entry), noise.gyro_random_walk);
  }
  if (key == "update_rate") {
    return store(yaml::positive(entry), noise.rate_hz);
  }
  // What Kalibr writes besides; T_i_b and time_offset relate further IMUs to the first.
  if (key == "rostopic" || key == "model" || key == "T_i_b" || key == "time_offset") {
    return ignore();
  }
  return tl::unexpected{entry.error("an unknown key")};
}

}  // namespace

Result<Calibration> parse_camchain(std::string_view file, std::string content) {
  const auto top = yaml::parse(file, std::move(content));
  if (!top) {
    return tl::unexpected{top.error()};
  }
  Calibration calibration;
  auto read = yaml::for_each(*top, [&](const Entry& entry, std::string_view key) {
    return read_top_key(entry, key, calibration);
  });
  if (!read) {
    return tl::unexpected{std::move(read.error())};
  }
  if (calibration.camera.fx == 0) {
    return tl::unexpected{top->error("cam0 is missing")};
  }
  calibration.source = file;
  return calibration;
}

Result<ImuNoise> parse_imu(std::string_view file, std::string content) {
  const auto top = yaml::parse(file, std::move(content));
  if (!top) {
    return tl::unexpected{top.error()};
  }
  ImuNoise noise;
  auto read = yaml::for_each(*top, [&](const Entry& entry, std::string_view key) {
    if (key != "imu0") {
      return read_imu_key(entry, key, noise);
    }
    return yaml::for_each(entry, [&](const Entry& value, std::string_view inner) {
      return read_imu_key(value, inner, noise);
    });
  });
  if (!read) {
    return tl::unexpected{std::move(read.error())};
  }
  return noise;
}

}  // namespace geoflow::drivers::kalibr
