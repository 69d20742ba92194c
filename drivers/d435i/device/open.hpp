#pragma once

#include <memory>
#include <string>

#include "geoflow/hal/result.hpp"

#include "d435i/core/transport.hpp"

namespace geoflow::drivers::d435i {

/// Opens a camera by the kernel's drivers where they show depth, colour and both sensors; else by
/// USB. An OpenTransport.
[[nodiscard]] Result<std::unique_ptr<Transport>> open_by_either(const std::string& serial);

}  // namespace geoflow::drivers::d435i
