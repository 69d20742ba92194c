#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <malloc.h>
#include <tbb/parallel_invoke.h>
#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/cpu_time.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/lanes.hpp"
#include "geoflow/tools/simulator/mount.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"

#include "src/color_view.hpp"
#include "src/infrared_view.hpp"
#include "src/lighting.hpp"
#include "src/ray_scene.hpp"
#include "src/registration.hpp"
#include "src/sensor.hpp"
#include "src/shader.hpp"
#include "src/steady_tiles.hpp"
#include "src/stereo.hpp"

namespace geoflow::simulator {
namespace {

// Automatic exposure follows the scene with a lag: it has seen it this long before, newer views
// counting more.
struct Metering {
  double before_s;
  double weight;
};
constexpr std::array<Metering, 3> kMeterings{{{.before_s = 0.1, .weight = 0.5},
                                              {.before_s = 0.25, .weight = 0.3},
                                              {.before_s = 0.45, .weight = 0.2}}};

// NOLINTBEGIN(readability-magic-numbers): the last two of each row are its range
constexpr std::array<Knob<CameraOptions>, 17> kKnobs{{
    {.name = "camera.width",
     .unit = "px",
     .summary = "width of all images",
     .member = &CameraOptions::width,
     .minimum = 32,
     .maximum = 1920},
    {.name = "camera.height",
     .unit = "px",
     .summary = "height of all images",
     .member = &CameraOptions::height,
     .minimum = 32,
     .maximum = 1080},
    {.name = "camera.exposure_min_s",
     .unit = "s",
     .summary = "shortest exposure",
     .member = &CameraOptions::exposure_min_s,
     .minimum = 1e-6,
     .maximum = 0.033},
    {.name = "camera.exposure_max_s",
     .unit = "s",
     .summary = "longest exposure; then gain rises",
     .member = &CameraOptions::exposure_max_s,
     .minimum = 1e-6,
     .maximum = 0.2},
    {.name = "camera.gain_max",
     .unit = "1",
     .summary = "largest gain",
     .member = &CameraOptions::gain_max,
     .minimum = 1,
     .maximum = 256},
    {.name = "camera.exposure_compensation",
     .unit = "1",
     .summary = "times the brightness that exposure aims at",
     .member = &CameraOptions::exposure_compensation,
     .minimum = 0.1,
     .maximum = 10},
    {.name = "camera.noise_scale",
     .unit = "1",
     .summary = "times the colour sensor's noise",
     .member = &CameraOptions::noise_scale,
     .minimum = 0,
     .maximum = 20},
    {.name = "camera.subexposures",
     .unit = "",
     .summary = "rays a pixel, spread over its exposure",
     .member = &CameraOptions::subexposures,
     .minimum = 1,
     .maximum = 64},
    {.name = "camera.readout_s",
     .unit = "s",
     .summary = "rolling shutter: from the first row to the last",
     .member = &CameraOptions::readout_s,
     .minimum = 0,
     .maximum = 0.033},
    {.name = "camera.depth_offset_s",
     .unit = "s",
     .summary = "depth is this much later than colour",
     .member = &CameraOptions::depth_offset_s,
     .minimum = -0.05,
     .maximum = 0.05},
    {.name = "camera.depth_noise_scale",
     .unit = "1",
     .summary = "times all errors of disparity",
     .member = &CameraOptions::depth_noise_scale,
     .minimum = 0,
     .maximum = 20},
    {.name = "camera.depth_errors",
     .unit = "",
     .summary = "holes, ragged edges, flying pixels",
     .member = &CameraOptions::depth_errors,
     .minimum = 0,
     .maximum = 1},
    {.name = "camera.depth_subpixel_px",
     .unit = "px",
     .summary = "deviation of disparity where the pattern is well seen",
     .member = &CameraOptions::depth_subpixel_px,
     .minimum = 0,
     .maximum = 2},
    {.name = "camera.depth_calibration_px",
     .unit = "px",
     .summary = "deviation of disparity at 640 x 480 that calibration leaves in all frames",
     .member = &CameraOptions::depth_calibration_px,
     .minimum = 0,
     .maximum = 2},
    {.name = "camera.depth_min_m",
     .unit = "m",
     .summary = "nearest depth",
     .member = &CameraOptions::depth_min_m,
     .minimum = 0,
     .maximum = 5},
    {.name = "camera.depth_max_m",
     .unit = "m",
     .summary = "farthest depth",
     .member = &CameraOptions::depth_max_m,
     .minimum = 0.5,
     .maximum = 65},
    {.name = "camera.projector_power",
     .unit = "1",
     .summary = "times the infrared pattern's brightness",
     .member = &CameraOptions::projector_power,
     .minimum = 0,
     .maximum = 20},
}};
// NOLINTEND(readability-magic-numbers)

Result<void> check(const CameraOptions& options) {
  for (const Knob<CameraOptions>& knob : kKnobs) {
    const double value = knob_value(knob, options);
    if (!(value >= knob.minimum && value <= knob.maximum)) {
      return fail(ErrorCode::kInvalidArgument, "{}: {} is outside {} to {} {}", knob.name, value,
                  knob.minimum, knob.maximum, knob.unit);
    }
  }
  if (options.exposure_min_s > options.exposure_max_s ||
      options.depth_min_m > options.depth_max_m) {
    return fail(
        ErrorCode::kInvalidArgument,
        "camera: a minimum (exposure_min_s {}, depth_min_m {}) is above its maximum ({}, {})",
        options.exposure_min_s, options.depth_min_m, options.exposure_max_s, options.depth_max_m);
  }
  if (options.color_format != PixelFormat::kBgr8 && options.color_format != PixelFormat::kGray8) {
    return fail(ErrorCode::kInvalidArgument,
                "camera: the colour format is neither kBgr8 nor kGray8");
  }
  return {};
}

/// Intrinsics measured at 640 x 480, at another size.
CameraIntrinsics scaled(const CameraIntrinsics& vga, int width, int height) {
  CameraIntrinsics result = vga;
  const double across = static_cast<double>(width) / vga.width;
  const double down = static_cast<double>(height) / vga.height;
  result.width = width;
  result.height = height;
  result.fx *= across;
  result.fy *= down;
  result.cx = (vga.cx + 0.5) * across - 0.5;
  result.cy = (vga.cy + 0.5) * down - 0.5;
  return result;
}

}  // namespace

std::span<const Knob<CameraOptions>> camera_knobs() {
  return kKnobs;
}

void keep_freed_memory() noexcept {
  constexpr int kLargestAllowed = 32 * 1024 * 1024;  // DEFAULT_MMAP_THRESHOLD_MAX of glibc
  constexpr int kNever = std::numeric_limits<int>::max();
  // NOLINTBEGIN(concurrency-mt-unsafe): said where it is declared
  mallopt(M_MMAP_THRESHOLD, kLargestAllowed);
  mallopt(M_TRIM_THRESHOLD, kNever);
  // NOLINTEND(concurrency-mt-unsafe)
}

SE3 d435i_T_cam_ir() {
  return d435i_T_depth_cam().inverse();
}

// NOLINTBEGIN(readability-magic-numbers): calibrations of real devices
CameraIntrinsics d435i_color_intrinsics(int width, int height) {
  // The published calibration of the D435i on a Go2.
  return scaled({.width = 640,
                 .height = 480,
                 .fx = 608.758057,
                 .fy = 608.546509,
                 .cx = 315.648743,
                 .cy = 243.935272},
                width, height);
}

CameraIntrinsics d435i_ir_intrinsics(int width, int height) {
  // The middle of several devices.
  return scaled({.width = 640, .height = 480, .fx = 383.5, .fy = 383.5, .cx = 320.2, .cy = 236.2},
                width, height);
}
// NOLINTEND(readability-magic-numbers)

struct CameraSimulator::Parts {
  Parts(const Scene& of, const CameraOptions& with, std::unique_ptr<RayScene> traced)
      : scene{&of},
        options{with},
        rays{std::move(traced)},
        lighting{of, *rays},
        shader{of, *rays, lighting},
        registration{.depth = d435i_ir_intrinsics(with.width, with.height),
                     .color = d435i_color_intrinsics(with.width, with.height),
                     .T_cam_ir = d435i_T_cam_ir()} {}

  [[nodiscard]] Subject subject() const {
    return {.scene = *scene, .rays = *rays, .shader = shader};
  }

  [[nodiscard]] Exposure meter(double t_s, const PoseAt& T_world_cam) const {
    double luminance_nit = 0;
    for (const Metering& metering : kMeterings) {
      const double seen = static_cast<double>(metered_luminance(
          subject(), registration.color, T_world_cam(t_s - metering.before_s), t_s));
      luminance_nit += metering.weight * seen;
    }
    return choose_exposure(luminance_nit, options);
  }

  /// Depth as measured, in whole millimetres, registered to colour.
  [[nodiscard]] FrameRef measure_depth(double t_s, const PoseAt& T_world_cam, std::uint64_t key,
                                       RenderCost& cost) const {
    const double begin_s = thread_cpu_s();
    const SE3 T_world_ir = T_world_cam(t_s) * registration.T_cam_ir;
    const InfraredView seen = see_infrared(*rays, shader, registration.depth, T_world_ir, t_s,
                                           static_cast<float>(options.projector_power));
    cost.light_s = thread_cpu_s() - begin_s;
    const std::vector<float> depth_m = match_stereo(seen, registration.depth, options, key);
    FrameRef depth = FramePool{1}.acquire(
        {.width = options.width, .height = options.height, .format = PixelFormat::kDepth16});
    std::vector<std::uint16_t> millimetres(depth_m.size());
    align_to_color(depth_m, registration, millimetres);
    std::ranges::copy(std::as_bytes(std::span{millimetres}), depth.writable_bytes().begin());
    cost.sensor_s = thread_cpu_s() - begin_s - cost.light_s;
    return depth;
  }

  const Scene* scene;
  CameraOptions options;
  std::unique_ptr<RayScene> rays;
  Lighting lighting;
  Shader shader;
  Registration registration;
};

Result<std::unique_ptr<CameraSimulator>> CameraSimulator::create(const Scene& scene,
                                                                 const CameraOptions& options) {
  if (const Result<void> checked = check(options); !checked) {
    return tl::unexpected{checked.error()};
  }
  Result<std::unique_ptr<RayScene>> rays = RayScene::create(scene);
  if (!rays) {
    return tl::unexpected{rays.error()};
  }
  return std::unique_ptr<CameraSimulator>{
      new CameraSimulator{std::make_unique<Parts>(scene, options, *std::move(rays))}};
}

CameraSimulator::CameraSimulator(std::unique_ptr<Parts> parts) : parts_{std::move(parts)} {}
CameraSimulator::~CameraSimulator() = default;

Rendered CameraSimulator::render(double t_mid_exposure_s, std::uint64_t frame_index,
                                 const PoseAt& T_world_cam) {
  Parts& parts = *parts_;
  const CameraOptions& options = parts.options;
  const std::uint64_t key = subkey(subkey(options.seed, "camera"), frame_index);
  const double t_depth_s = t_mid_exposure_s + options.depth_offset_s;

  // The longest exposure, whatever will be chosen, and depth's moment.
  const double half_s = 0.5 * (options.exposure_max_s + options.readout_s);
  parts.rays->people().move(std::min(t_mid_exposure_s - half_s, t_depth_s),
                            std::max(t_mid_exposure_s + half_s, t_depth_s));
  parts.shader.move_people(t_mid_exposure_s);
  Rendered rendered;
  RenderCost color_cost;
  RenderCost depth_cost;
  const auto see_color = [&] {
    const double begin_s = thread_cpu_s();
    const Exposure exposure = parts.meter(t_mid_exposure_s, T_world_cam);
    const Shutter shutter{.t_mid_s = t_mid_exposure_s,
                          .exposure_s = exposure.exposure_s,
                          .readout_s = options.readout_s,
                          .rows = options.height};
    const std::vector<Rgb> light =
        expose(parts.subject(), parts.registration.color, shutter, T_world_cam,
               {.rays_a_pixel = options.subexposures, .key = subkey(key, "rays")});
    color_cost.light_s = thread_cpu_s() - begin_s;
    rendered.color = develop(light, exposure, options, subkey(key, "sensor"));
    color_cost.sensor_s = thread_cpu_s() - begin_s - color_cost.light_s;
    rendered.exposure_s = exposure.exposure_s;
    rendered.gain = exposure.gain;
  };
  const auto see_depth = [&] {
    rendered.depth = parts.measure_depth(t_depth_s, T_world_cam, subkey(key, "stereo"), depth_cost);
    if (options.depth_truth) {
      rendered.depth_truth =
          true_depth(*parts.rays, parts.registration.color, T_world_cam(t_mid_exposure_s),
                     parts.rays->people().ray_time(t_mid_exposure_s));
    }
  };
  tbb::parallel_invoke(see_color, see_depth);
  rendered.cost = {.light_s = color_cost.light_s + depth_cost.light_s,
                   .sensor_s = color_cost.sensor_s + depth_cost.sensor_s};
  return rendered;
}

const CameraIntrinsics& CameraSimulator::intrinsics() const noexcept {
  return parts_->registration.color;
}

double CameraSimulator::lookback_s() noexcept {
  return kMeterings.back().before_s;
}

}  // namespace geoflow::simulator
