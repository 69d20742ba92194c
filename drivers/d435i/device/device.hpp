#pragma once

#include <memory>

#include "geoflow/drivers/d435i.hpp"
#include "geoflow/hal/result.hpp"

#include "d435i/core/transport.hpp"

namespace geoflow::drivers::d435i {

/// D435i::open() over any way to the camera.
[[nodiscard]] Result<std::unique_ptr<D435i>> open_device(const D435iOptions& options,
                                                         const OpenTransport& open);

}  // namespace geoflow::drivers::d435i
