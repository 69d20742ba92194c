#include "d435i/core/camera_facts.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"

#include "d435i/core/monitor.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/monitor/command.hpp"
#include "d435i/monitor/tables.hpp"
#include "d435i/monitor/versions.hpp"
#include "d435i/uvc/descriptors.hpp"

namespace geoflow::drivers::d435i {
namespace {

/// One request for facts: asks and reads.
class Questions {
 public:
  explicit Questions(Transport& transport) : transport_{transport} {}

  [[nodiscard]] Result<Versions> versions() const {
    return ask({.opcode = Opcode::kVersions}).and_then([](const auto& data) {
      return parse_versions(data);
    });
  }
  [[nodiscard]] Result<DepthTable> depth_table() const {
    return table(kCoefficientsTable).and_then([](const auto& data) {
      return parse_depth_table(data);
    });
  }
  [[nodiscard]] Result<ColorTable> color_table() const {
    return table(kColorTable).and_then([](const auto& data) { return parse_color_table(data); });
  }

  /// Empty where the firmware has no such list.
  [[nodiscard]] std::vector<CameraIntrinsics> resolutions() const {
    return ask({.opcode = Opcode::kResolutionIntrinsics})
        .and_then([](const auto& data) { return parse_resolution_intrinsics(data); })
        .value_or(std::vector<CameraIntrinsics>{});
  }

  /// Advanced mode may have changed it.
  [[nodiscard]] double depth_unit_m() const {
    const auto advanced = ask({.opcode = Opcode::kAdvancedMode});
    if (!advanced || advanced->empty() || advanced->front() == std::byte{0}) {
      return kDefaultDepthUnit_m;
    }
    const auto unit_m =
        ask({.opcode = Opcode::kAdvancedParameters, .parameters = {kDepthUnitGroup, 0, 0, 0}})
            .and_then([](const auto& data) { return parse_depth_unit_m(data); });
    return unit_m.value_or(kDefaultDepthUnit_m);
  }

  [[nodiscard]] ImuTable imu_table() const {
    constexpr std::uint32_t kImuCalibrationBytes = 520;
    const auto table =
        ask({.opcode = Opcode::kImuCalibration, .parameters = {0, kImuCalibrationBytes, 0, 0}})
            .and_then([](const auto& data) { return parse_imu_table(data); });
    if (!table && table.error().code != ErrorCode::kNotFound) {
      log::warning("d435i", "{}; the IMU is taken as drawn", table.error().message);
    }
    return table.value_or(ImuTable{});
  }

 private:
  [[nodiscard]] Result<std::vector<std::byte>> ask(const MonitorCommand& command) const {
    return ask_monitor(transport_, command);
  }
  [[nodiscard]] Result<std::vector<std::byte>> table(std::uint32_t id) const {
    return ask({.opcode = Opcode::kCalibrationTable, .parameters = {id, 0, 0, 0}});
  }

  Transport& transport_;
};

}  // namespace

Result<CameraTables> read_tables(Transport& transport) {
  const Questions camera{transport};
  auto versions = camera.versions();
  if (!versions) {
    return tl::unexpected{std::move(versions.error()).in("D435i")};
  }
  auto depth = camera.depth_table();
  auto color = camera.color_table();
  if (!depth || !color) {
    return tl::unexpected{depth ? color.error() : depth.error()};
  }
  return CameraTables{.versions = std::move(*versions),
                      .depth = std::move(*depth),
                      .color = *color,
                      .resolutions = camera.resolutions(),
                      .depth_unit_m = camera.depth_unit_m(),
                      .imu = camera.imu_table()};
}

Result<CameraFacts> facts_of(const CameraTables& tables, const VideoMode& depth,
                             const VideoMode& color) {
  const auto listed = std::ranges::find_if(tables.resolutions, [&](const CameraIntrinsics& camera) {
    return camera.width == depth.width && camera.height == depth.height;
  });
  const auto depth_camera = listed != tables.resolutions.end()
                                ? Result<CameraIntrinsics>{*listed}
                                : depth_intrinsics(tables.depth, depth.width, depth.height);
  if (!depth_camera) {
    return tl::unexpected{depth_camera.error()};
  }
  return CameraFacts{
      .versions = tables.versions,
      .geometry = {.depth = *depth_camera,
                   .color = color_intrinsics(tables.color, color.width, color.height),
                   .T_cam_depth = tables.color.T_depth_cam.inverse(),
                   .depth_unit_m = tables.depth_unit_m},
      .baseline_m = tables.depth.baseline_m,
      .imu = tables.imu};
}

Result<CameraFacts> read_facts(Transport& transport, const VideoMode& depth,
                               const VideoMode& color) {
  return read_tables(transport).and_then(
      [&](const CameraTables& tables) { return facts_of(tables, depth, color); });
}

Calibration calibration_of(const CameraFacts& facts) {
  const SE3 T_imu_depth = facts.imu.T_imu_depth.value_or(default_imu_pose());
  const SE3& T_cam_depth = facts.geometry.T_cam_depth;
  return {.camera = facts.geometry.color,
          .depth_unit_m = facts.geometry.depth_unit_m,
          .depth_alignment = DepthAlignment::kExact,
          .T_cam_imu = T_cam_depth * T_imu_depth.inverse(),
          .source = fmt::format("D435i {}, firmware {}", facts.versions.serial,
                                facts.versions.firmware.text()),
          .serial = facts.versions.serial};
}

}  // namespace geoflow::drivers::d435i
