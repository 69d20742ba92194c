#pragma once

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"

namespace geoflow::slam {

/// Two views whose depth agrees in this share of the surfels are of one place.
inline constexpr double kGoodOverlap = 0.7;

/// Registration from a guess that may be far off, as after a gap: besides the guess, no motion at
/// all, and, unless one of these reaches kGoodOverlap, motions around that in every direction. The
/// one that fits most of the surfels is returned. Pure and deterministic.
[[nodiscard]] RegistrationResult register_from_afar(const DepthCloud& source,
                                                    const DepthCloud& target,
                                                    const SE3& T_target_source_guess,
                                                    const GicpConfig& config);

}  // namespace geoflow::slam
