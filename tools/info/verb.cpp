#include "geoflow/tools/verb.hpp"

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "info/sheet.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

json to_json(const std::optional<SE3>& transform) {
  if (!transform) {
    return nullptr;
  }
  const Vector3d& p = transform->translation();
  const Eigen::Quaterniond& q = transform->rotation();
  return {{"p", {p.x(), p.y(), p.z()}}, {"q", {q.x(), q.y(), q.z(), q.w()}}};
}

json to_json(const Calibration& calibration) {
  const CameraIntrinsics& camera = calibration.camera;
  return {{"source", calibration.source},
          {"serial", calibration.serial},
          {"width", camera.width},
          {"height", camera.height},
          {"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy},
          {"distortion", camera.distortion},
          {"depth_unit_m", calibration.depth_unit_m},
          {"timeshift_cam_imu_s", to_seconds(calibration.timeshift_cam_imu)},
          {"T_cam_imu", to_json(calibration.T_cam_imu)},
          {"T_base_cam", to_json(calibration.T_base_cam)}};
}

json to_json(const drivers::RecordingInfo& info) {
  json streams = json::array();
  for (const auto& stream : info.streams) {
    const json as = stream.stream ? json(std::string{drivers::name(*stream.stream)}) : json{};
    streams.push_back(
        {{"name", stream.name}, {"type", stream.type}, {"count", stream.count}, {"read_as", as}});
  }
  return {{"format", info.format},
          {"start_ns", info.start.time_since_epoch().count()},
          {"end_ns", info.end.time_since_epoch().count()},
          {"duration_s", to_seconds(info.end - info.start)},
          {"streams", std::move(streams)}};
}

class InfoVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "info"; }
  [[nodiscard]] std::string_view summary() const override { return "Say what a recording holds"; }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow info kitchen-400            format, duration, streams, calibration\n"
           "  geoflow info bag --json             the same for scripts; keys in docs/cli.md\n"
           "  geoflow info bag --sheet sheet.png  a few of its images beside their depth\n"
           "  geoflow info scene0050_00.sens --reference groundtruth.txt\n"
           "      write the camera poses that the recording holds as its truth, as TUM text";
  }

  void declare(CLI::App& command) override {
    command.add_option("recording", recording_, "The recording's folder")->required();
    command.add_option("--calibration", calibration_, "Folder with Kalibr files");
    command.add_option("--sheet", sheet_,
                       "Draw a few of its images, with depth, to this .png file");
    command.add_option("--reference", reference_,
                       "Write the recording's own true camera poses to this file");
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    drivers::RecordingOptions options{.path = recording_};
    if (!calibration_.empty()) {
      options.calibration = calibration_;
    }
    const auto streams = drivers::RecordedStreams::open(options);
    if (!streams) {
      return tl::unexpected{streams.error()};
    }
    json object = to_json((*streams)->info());
    const Trajectory& reference = (*streams)->reference();
    object["calibration"] = to_json((*streams)->calibration());
    object["reference_poses"] = reference.size();
    console.object(object);
    print((*streams)->info(), (*streams)->calibration(), console);
    if (!reference.empty()) {
      console.line("reference    {} true camera poses", reference.size());
    }
    return write_reference(reference)
        .and_then([&] { return sheet_.empty() ? Result<void>{} : draw_sheet(**streams, sheet_); })
        .map([] { return ExitCode::kOk; });
  }

 private:
  [[nodiscard]] Result<void> write_reference(const Trajectory& reference) const {
    if (reference_.empty()) {
      return {};
    }
    if (reference.empty()) {
      return fail(ErrorCode::kNotFound, "{}: holds no true poses of its own", recording_);
    }
    return write_tum(reference_, reference);
  }

  static void print(const drivers::RecordingInfo& info, const Calibration& calibration,
                    Console& console) {
    console.line("format       {}", info.format);
    console.line("duration     {:.3f} s", to_seconds(info.end - info.start));
    for (const auto& stream : info.streams) {
      console.line("stream       {:8} {} ({}){}", stream.count, stream.name, stream.type,
                   stream.stream ? "" : ", not read");
    }
    if (!info.has(drivers::StreamId::kColor) || !info.has(drivers::StreamId::kDepth)) {
      console.line("camera       no {} images: it cannot be replayed",
                   info.has(drivers::StreamId::kColor) ? "depth" : "colour");
      return;
    }
    const CameraIntrinsics& camera = calibration.camera;
    console.line("camera       {} x {} px, fx {} fy {} cx {} cy {}, depth unit {} m", camera.width,
                 camera.height, camera.fx, camera.fy, camera.cx, camera.cy,
                 calibration.depth_unit_m);
    console.line("calibration  {}", calibration.source);
    console.line("extrinsics   imu: {}, base: {}", calibration.T_cam_imu ? "given" : "none",
                 calibration.T_base_cam ? "given" : "none, base is the camera");
  }

  std::string recording_;
  std::string calibration_;
  std::string reference_;
  std::string sheet_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_info_verb() {
  return std::make_unique<InfoVerb>();
}

}  // namespace geoflow::tools
