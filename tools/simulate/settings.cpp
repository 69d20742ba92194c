#include "simulate/settings.hpp"

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/image.hpp"
#include "geoflow/hal/nearest_name.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/imu_simulator.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/leg_simulator.hpp"
#include "geoflow/tools/simulator/recording_options.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/simulation.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

namespace geoflow::tools {
namespace {

using simulator::KnobInfo;
using simulator::SimulationOptions;

/// Calls `visit(table, member)` for each room's table of knobs and the options that it is about.
template <typename Options, typename Visit>
void for_each_table(Options& options, const Visit& visit) {
  visit(simulator::scene_knobs(), options.place);
  visit(simulator::camera_knobs(), options.camera);
  visit(simulator::walk_knobs(), options.walk);
  visit(simulator::leg_knobs(), options.legs);
  visit(simulator::imu_knobs(), options.imu);
  visit(simulator::recording_knobs(), options.recording);
}

std::string did_you_mean(const std::vector<std::string_view>& names, std::string_view unknown) {
  return fmt::format("did you mean {}?", nearest_name(names, unknown));
}

}  // namespace

const std::vector<Preset>& presets() {
  static const std::vector<Preset> known = {
      {.name = "pronounced-trot",
       .summary = "a fast trot that shakes and blurs, as in the paper's recordings",
       .apply =
           [](SimulationOptions& options) {
             options.walk = simulator::with_pronounced_trot(options.walk);
           }},
      {.name = "hard-shocks",
       .summary = "the IMU is hit by up to 40 m/s^2 at every step, as in the paper's figure 9",
       .apply =
           [](SimulationOptions& options) {
             options.imu = simulator::with_hard_shocks(options.imu);
           }},
      {.name = "exact-sensors",
       .summary = "IMU and legs without noise, bias, shocks and quanta",
       .apply =
           [](SimulationOptions& options) {
             options.imu = simulator::exact_imu();
             options.legs = simulator::exact_legs();
           }},
  };
  return known;
}

std::vector<KnobInfo> all_knobs() {
  std::vector<KnobInfo> all;
  const SimulationOptions defaults;
  for_each_table(defaults, [&](const auto& table, const auto& /*options*/) {
    for (const auto& knob : table) {
      all.push_back(simulator::describe(knob));
    }
  });
  return all;
}

Result<void> set_knob(SimulationOptions& options, std::string_view assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos) {
    return fail(ErrorCode::kInvalidArgument, "--set {}: NAME=VALUE is expected", assignment);
  }
  const std::string_view name = assignment.substr(0, equals);
  Result<bool> done = false;
  for_each_table(options, [&](const auto& table, auto& own) {
    if (done && !*done) {
      done = simulator::set_knob(table, name, assignment.substr(equals + 1), own);
    }
  });
  if (!done) {
    return tl::unexpected{done.error()};
  }
  if (!*done) {
    std::vector<std::string_view> names;
    for (const KnobInfo& knob : all_knobs()) {
      names.push_back(knob.name);
    }
    return fail(ErrorCode::kInvalidArgument, "--set {}: there is no knob {}; {}", assignment, name,
                did_you_mean(names, name));
  }
  return {};
}

Result<void> apply_preset(SimulationOptions& options, std::string_view name) {
  std::vector<std::string_view> names;
  for (const Preset& preset : presets()) {
    if (preset.name == name) {
      preset.apply(options);
      return {};
    }
    names.push_back(preset.name);
  }
  return fail(ErrorCode::kInvalidArgument, "--preset {}: there is none; {}", name,
              did_you_mean(names, name));
}

nlohmann::json to_json(const SimulationOptions& options) {
  nlohmann::json knobs = nlohmann::json::object();
  for_each_table(options, [&](const auto& table, const auto& own) {
    for (const auto& knob : table) {
      knobs[std::string{knob.name}] = simulator::knob_value(knob, own);
    }
  });
  return {{"scene", options.scene},
          {"seed", options.seed},
          {"duration_s", options.duration_s},
          {"gray", options.camera.color_format == PixelFormat::kGray8},
          {"knobs", knobs}};
}

}  // namespace geoflow::tools
