#pragma once

#include <cstdint>
#include <vector>

#include "geoflow/hal/image.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/texture.hpp"

namespace geoflow::simulator {

struct Exposure {
  double exposure_s = 0;
  double gain = 1;
};

/// The exposure that brings a metered luminance [cd/m^2] to middle grey: as long as allowed, then
/// gain.
[[nodiscard]] Exposure choose_exposure(double luminance_nit, const CameraOptions& options);

/// From luminance to 8-bit pixels in the options' format: photons, read noise, gain, saturation,
/// sRGB. Noise of a pixel depends on `key` and its place alone.
[[nodiscard]] FrameRef develop(const std::vector<Rgb>& luminance_nit, const Exposure& exposure,
                               const CameraOptions& options, std::uint64_t key);

}  // namespace geoflow::simulator
