#pragma once

#include <cstdint>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/tools/simulator/camera.hpp"

#include "src/infrared_view.hpp"

namespace geoflow::simulator {

/// Depth as a D435i's stereo matcher measures it in the left infrared camera [m], row by row, 0
/// where it has none. It errs in disparity d = f * 50 mm / z, thus in depth with z^2:
/// - Matching: normal, of `depth_subpixel_px` where the pattern is well seen, more where it is
///   faint: times sqrt(1 + (0.06 / signal)^2). Neighbours' windows overlap (L. Keselman et al.,
///   "Intel RealSense stereoscopic depth cameras", CVPRW 2017): correlation falls to a half over 11
///   x 7 pixels. Anew in each frame.
/// - Between whole pixels windows find a little more above the whole number and less below the next
///   one: a ripple of 0.012 px (A. Grunnet-Jepsen et al., "Subpixel linearity improvement for Intel
///   RealSense depth camera D400 series", Intel).
/// - What calibration leaves of distortion and rectification: `depth_calibration_px`, smooth over
///   the image, the same in all frames.
/// - Disparity comes in steps of 1/32 px (datasheet).
///
/// No measurement: where the right camera sees something nearer or nothing, at the left border,
/// where the signal is too faint, beside steps in depth, nearer than `depth_min_m` or farther than
/// `depth_max_m`. Beside steps, edges are ragged by a pixel or two, and some pixels lie between the
/// two surfaces.
///
/// How noise grows with faintness, how far it is alike, and the ripple were measured on a concrete
/// floor that a real D435 saw at a grazing angle; the faintest signal is that of its holes, 1
/// percent from 2.5 to 3.5 m. `key` decides what is random in one frame, the options' seed what is
/// the device's own.
[[nodiscard]] std::vector<float> match_stereo(const InfraredView& seen,
                                              const CameraIntrinsics& intrinsics,
                                              const CameraOptions& options, std::uint64_t key);

}  // namespace geoflow::simulator
