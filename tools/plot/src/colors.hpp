#pragma once

#include "geoflow/tools/plot.hpp"

namespace geoflow::tools {

/// The colour of a fraction, 0 (dark blue) to 1 (yellow); clamped; NaN: grey. Anchors of the
/// "plasma" map of S. van der Walt and N. Smith (matplotlib, CC0) up to 0.9, beyond which it is too
/// pale on white.
[[nodiscard]] Color color_map(double fraction) noexcept;

}  // namespace geoflow::tools
