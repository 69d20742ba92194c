#pragma once

#include "geoflow/hal/samples.hpp"

/// Whether a sample says something that can be computed with.
namespace geoflow::timesync {

[[nodiscard]] bool is_usable(const ImuSample& sample);  ///< all components finite
[[nodiscard]] bool is_usable(
    const LegSample& sample);  ///< all joints of the valid legs and all forces finite
[[nodiscard]] bool is_usable(const BodyVelocitySample& sample);  ///< all components finite
[[nodiscard]] bool is_usable(const ColorFrame& frame);           ///< has an image
[[nodiscard]] bool is_usable(const DepthFrame& frame);           ///< has an image

}  // namespace geoflow::timesync
