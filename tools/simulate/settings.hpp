#pragma once

#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/simulation.hpp"

/// The simulator's knobs as one list, whichever options they belong to.
namespace geoflow::tools {

/// Several knobs set at once, by one name.
struct Preset {
  std::string_view name;
  std::string_view summary;
  void (*apply)(simulator::SimulationOptions&);
};

[[nodiscard]] const std::vector<Preset>& presets();

/// Every knob there is, room by room.
[[nodiscard]] std::vector<simulator::KnobInfo> all_knobs();

/// Sets one knob by `name=value`. Errors (kInvalidArgument): no such form; an unknown name, with
/// the nearest known one; a value that the knob does not take, with its range.
[[nodiscard]] Result<void> set_knob(simulator::SimulationOptions& options,
                                    std::string_view assignment);

/// Applies a preset; an unknown name is an error with the nearest known one.
[[nodiscard]] Result<void> apply_preset(simulator::SimulationOptions& options,
                                        std::string_view name);

/// Scene, seed, duration and the value of every knob.
[[nodiscard]] nlohmann::json to_json(const simulator::SimulationOptions& options);

}  // namespace geoflow::tools
