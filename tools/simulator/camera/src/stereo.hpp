#pragma once

#include <cstdint>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/tools/simulator/camera.hpp"

#include "src/infrared_view.hpp"

namespace geoflow::simulator {

/// Depth as a D435i's stereo matcher measures it in the left infrared camera [m], row by row, 0
/// where it has none.
/// - Disparity d = f * 50 mm / z has a deviation of `depth_subpixel_px` where the pattern is well
/// seen, more where it is faint:
///   0.05 px * sqrt(1 + (0.06 / signal)^2); it is correlated over about 8 x 6 pixels. So depth errs
///   with z^2.
/// - No measurement: where the right camera sees something nearer or nothing, at the left border,
/// where the signal is
///   too faint, beside steps in depth, nearer than `depth_min_m` or farther than `depth_max_m`.
/// - Beside steps, edges are ragged by a pixel or two, and some pixels lie between the two
/// surfaces.
/// - Disparity comes in steps of 1/32 px (datasheet).
/// The deviation and the lengths of correlation were fitted to the floor in real D435 recordings:
/// 0.05 px from 0.75 to 1.25 m, 0.10 px at 2.25 m, 0.25 px at 3 m of a concrete floor seen at a
/// grazing angle; and the faintest signal to that floor's holes, 1 percent from 2.5 to 3.5 m. `key`
/// decides all that is random.
[[nodiscard]] std::vector<float> match_stereo(const InfraredView& seen,
                                              const CameraIntrinsics& intrinsics,
                                              const CameraOptions& options, std::uint64_t key);

/// Deviation of disparity over its best for a signal.
[[nodiscard]] float disparity_spread(float signal) noexcept;

}  // namespace geoflow::simulator
