#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/scene.hpp"

/// A RealSense D435i looking at a scene: ray-traced colour with motion blur, rolling shutter,
/// automatic exposure and sensor noise; and depth of its infrared stereo pair with that pair's
/// errors, registered to colour.
namespace geoflow::simulator {

/// Pose of the colour camera's optical frame in the world at a time [s]. Called from several
/// threads at once, and for times up to CameraSimulator::lookback_s() before the frame.
using PoseAt = std::function<SE3(double t_s)>;

struct CameraOptions {
  // NOLINTBEGIN(readability-magic-numbers): each default is named, and given its unit, by its
  // member
  std::uint64_t seed = 1;
  int width = 640;  ///< [px] of colour, of depth and of the infrared pair; intrinsics scale with it
  int height = 480;                               ///< [px]
  PixelFormat color_format = PixelFormat::kBgr8;  ///< or kGray8
  // Colour. Exposure limits: of 30 frames/s.
  double exposure_min_s = 0.0001;
  double exposure_max_s = 0.033;
  double gain_max = 16.0;            ///< over the sensor's base sensitivity
  double exposure_compensation = 1;  ///< times what automatic exposure aims at
  double noise_scale = 1.0;          ///< times the deviation of photon and read noise
  int subexposures = 4;              ///< rays a pixel, spread over its exposure
  double readout_s = 0.020;          ///< rolling shutter: from the first to the last row
  // Depth.
  double depth_offset_s = 0;  ///< the infrared exposure is this much after the middle of colour's
  double depth_noise_scale = 1.0;  ///< times all errors of disparity; 0: none, and no rounding
  bool depth_errors =
      true;  ///< holes, ragged edges and flying pixels; false: only range, noise and rounding
  /// Deviation of disparity where the pattern is well seen. Intel's tuning guides call 0.05 px good
  /// and 0.08 px typical for all errors about a plane together
  double depth_subpixel_px = 0.06;
  /// Deviation over the image of what calibration leaves: an error of disparity that one device has
  /// in all frames; in pixels of an image 640 wide
  double depth_calibration_px = 0.03;
  double depth_min_m = 0.28;
  double depth_max_m = 20.0;
  double projector_power = 1.0;  ///< times the infrared pattern's brightness; 0: off
  bool depth_truth = false;      ///< Rendered::depth_truth is wanted
  // NOLINTEND(readability-magic-numbers)
};

/// The knobs of CameraOptions, "camera.…".
[[nodiscard]] std::span<const Knob<CameraOptions>> camera_knobs();

/// CPU time that a frame's steps took of the threads that began them [s]: all of it where the TBB
/// arena has one thread.
struct RenderCost {
  double light_s = 0;   ///< what there is to see: rays traced, surfaces shaded
  double sensor_s = 0;  ///< what the sensors make of it: noise, stereo matching, registration
};

/// One pair of images and what is true of them.
struct Rendered {
  FrameRef color;
  FrameRef depth;                  ///< kDepth16 [mm], registered to colour; 0: no measurement
  std::vector<float> depth_truth;  ///< [m] along the optical axis, width * height, of the colour
                                   ///< view at mid exposure; 0: sky; empty unless wanted
  double exposure_s = 0;
  double gain = 1;
  RenderCost cost{};
};

/// Renders frames of one scene; the scene must outlive it. Frames may be rendered in any order: a
/// frame depends on the options' seed, its time and index and the poses, not on the frames before
/// or on the number of threads. One thread at a time; it works with the threads of the TBB arena
/// that it is called in.
class CameraSimulator {
 public:
  /// Builds the ray tracer's structures and the scene's light, which takes about a second. Errors:
  /// kInvalidArgument for options out of range, kSystem if the ray tracer cannot start.
  [[nodiscard]] static Result<std::unique_ptr<CameraSimulator>> create(
      const Scene& scene, const CameraOptions& options);
  CameraSimulator(const CameraSimulator&) = delete;
  CameraSimulator& operator=(const CameraSimulator&) = delete;
  ~CameraSimulator();

  [[nodiscard]] Rendered render(double t_mid_exposure_s, std::uint64_t frame_index,
                                const PoseAt& T_world_cam);

  /// Of colour and registered depth: the published calibration of a Go2's D435i, scaled to the
  /// options' size.
  [[nodiscard]] const CameraIntrinsics& intrinsics() const noexcept;

  /// Automatic exposure looks at the scene at times up to this much before a frame [s].
  [[nodiscard]] static double lookback_s() noexcept;

 private:
  struct Parts;
  explicit CameraSimulator(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

/// Lets the whole program keep the memory that it frees. A frame of 640 x 480 takes and frees some
/// eleven megabytes: given back to the kernel, their pages are faulted in anew for the next one,
/// which was measured to add 0.44 to the time that it takes (docs/benchmarks.md). For programs that
/// render many, before they start threads.
void keep_freed_memory() noexcept;

/// Pose of the left infrared camera in the colour camera's frame, as calibrated on a D435i.
// NOLINTNEXTLINE(readability-identifier-naming): a transform keeps its frames' names
[[nodiscard]] SE3 d435i_T_cam_ir();

/// Intrinsics of a D435i's colour camera and of its infrared cameras at a size [px].
[[nodiscard]] CameraIntrinsics d435i_color_intrinsics(int width, int height);
[[nodiscard]] CameraIntrinsics d435i_ir_intrinsics(int width, int height);

/// Distance between the infrared cameras [m].
inline constexpr double kD435iBaseline_m = 0.050;

}  // namespace geoflow::simulator
