#include "pipeline/camera_calibration.hpp"

#include <filesystem>

#include <tl/expected.hpp>

#include "geoflow/drivers/calibration_file.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {
namespace {

/// Another camera may sit elsewhere on another robot: poses would be of a frame that is none.
Result<void> check_camera(const Calibration& file, const Calibration& camera,
                          bool with_intrinsics) {
  if (!file.serial.empty() && !camera.serial.empty() && file.serial != camera.serial) {
    return fail(ErrorCode::kInvalidArgument,
                "{}: is of the camera with the serial number {}; this one has {}", file.source,
                file.serial, camera.serial);
  }
  if (with_intrinsics &&
      (file.camera.width != camera.camera.width || file.camera.height != camera.camera.height)) {
    return fail(ErrorCode::kInvalidArgument, "{}: is of a camera of {}x{}; this one is {}x{}",
                file.source, file.camera.width, file.camera.height, camera.camera.width,
                camera.camera.height);
  }
  return {};
}

}  // namespace

Result<void> complete_calibration(const std::filesystem::path& directory, bool with_intrinsics,
                                  Calibration& calibration) {
  const auto file = drivers::load_calibration(directory);
  if (!file) {
    return tl::unexpected{file.error()};
  }
  if (auto checked = check_camera(*file, calibration, with_intrinsics); !checked) {
    return checked;
  }
  if (with_intrinsics) {
    calibration.camera = file->camera;
  }
  calibration.T_base_cam = file->T_base_cam;
  if (file->T_cam_imu) {
    calibration.T_cam_imu = file->T_cam_imu;
    calibration.timeshift_cam_imu = file->timeshift_cam_imu;
  }
  calibration.imu_noise = file->imu_noise;
  calibration.source += ", " + file->source;
  return {};
}

}  // namespace geoflow::daemon
