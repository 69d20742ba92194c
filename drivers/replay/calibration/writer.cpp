#include "replay/calibration/writer.hpp"

#include <cstddef>
#include <iterator>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <fmt/core.h>
#include <fmt/format.h>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::drivers::kalibr {
namespace {

constexpr std::size_t kKalibrCoefficients = 4;

std::string_view model_name(DistortionModel model) {
  switch (model) {
    case DistortionModel::kRadtan:
      return "radtan";
    case DistortionModel::kEquidistant:
      return "equidistant";
    case DistortionModel::kNone:
      break;
  }
  return "none";
}

/// Kalibr's four coefficients; five only where the fifth says something, none where there is no
/// model.
std::span<const double> coefficients(const CameraIntrinsics& camera) {
  if (camera.model == DistortionModel::kNone) {
    return {};
  }
  const std::span<const double> all{camera.distortion};
  return camera.model == DistortionModel::kRadtan && all.back() != 0
             ? all
             : all.first(kKalibrCoefficients);
}

std::string rows(const SE3& transform, std::string_view indent) {
  const Eigen::Matrix4d matrix = transform.matrix();
  std::string text;
  for (Eigen::Index y = 0; y < matrix.rows(); ++y) {
    fmt::format_to(std::back_inserter(text), "{}- [{}, {}, {}, {}]\n", indent, matrix(y, 0),
                   matrix(y, 1), matrix(y, 2), matrix(y, 3));
  }
  return text;
}

}  // namespace

std::string write_camchain(const Calibration& calibration) {
  const CameraIntrinsics& camera = calibration.camera;
  std::string text = fmt::format(
      "cam0:\n"
      "  camera_model: pinhole\n"
      "  intrinsics: [{}, {}, {}, {}]\n"
      "  distortion_model: {}\n"
      "  distortion_coeffs: [{}]\n"
      "  resolution: [{}, {}]\n",
      camera.fx, camera.fy, camera.cx, camera.cy, model_name(camera.model),
      fmt::join(coefficients(camera), ", "), camera.width, camera.height);
  if (calibration.T_cam_imu) {
    text += "  T_cam_imu:\n" + rows(*calibration.T_cam_imu, "  ");
  }
  if (calibration.timeshift_cam_imu != Duration{}) {
    text += fmt::format("  timeshift_cam_imu: {}\n", to_seconds(calibration.timeshift_cam_imu));
  }
  if (calibration.T_base_cam) {
    text += "T_base_cam:\n" + rows(*calibration.T_base_cam, "");
  }
  text += fmt::format("depth_factor: {}\n", 1 / calibration.depth_unit_m);
  text += fmt::format("depth_alignment: {}\n", name_of(calibration.depth_alignment));
  if (!calibration.serial.empty()) {
    std::string quoted = calibration.serial;
    std::erase_if(quoted, [](char c) { return c == '\'' || c < ' '; });
    text += fmt::format("serial: '{}'\n", quoted);
  }
  return text;
}

std::string write_imu(const ImuNoise& noise) {
  return fmt::format(
      "accelerometer_noise_density: {}  # [m/s^2/sqrt(Hz)]\n"
      "accelerometer_random_walk: {}  # [m/s^3/sqrt(Hz)]\n"
      "gyroscope_noise_density: {}  # [rad/s/sqrt(Hz)]\n"
      "gyroscope_random_walk: {}  # [rad/s^2/sqrt(Hz)]\n"
      "update_rate: {}  # [Hz]\n",
      noise.accel_noise_density, noise.accel_random_walk, noise.gyro_noise_density,
      noise.gyro_random_walk, noise.rate_hz);
}

}  // namespace geoflow::drivers::kalibr
