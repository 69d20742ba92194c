#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"

/// The legs' encoders on CAN (docs/legs.md).
namespace geoflow::drivers {

struct CanLegsOptions {
  std::string interfaces = "can0";     ///< names with commas between them: `can0,can1`
  std::filesystem::path dictionary{};  ///< a DBC file; empty: the program's, config/go2_legs.dbc
  std::filesystem::path log{};         ///< gets every frame as candump -L writes it; empty: none
};

/// Legs on CAN. Whether the interfaces are there and what comes over them, health() says; an error
/// is a dictionary that cannot be used or a log that cannot be written, and names file and line.
[[nodiscard]] Result<std::unique_ptr<Legs>> open_can_legs(const CanLegsOptions& options);

}  // namespace geoflow::drivers
