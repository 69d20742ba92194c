#pragma once

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/emulator/d435i.hpp"

namespace geoflow::emulator {

/// Whether there can be a D435i with these options, in a world with that calibration; an Error says
/// what is not so.
[[nodiscard]] Result<void> check_options(const D435iOptions& options,
                                         const Calibration& calibration);

}  // namespace geoflow::emulator
