#include "geoflow/tools/verb.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/version.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/knob.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/simulation.hpp"

#include "simulate/settings.hpp"
#include "simulate/writer.hpp"

namespace geoflow::tools {
namespace {

constexpr double kShortestS = 0.1;
constexpr double kLongestS = 7200;

constexpr std::string_view kExamples =
    "  geoflow simulate office -o bag --seed 7 --duration 60       a minute's walk through an "
    "office\n"
    "  geoflow simulate corridor -o bag --preset pronounced-trot --preset hard-shocks\n"
    "      harder: a shaking camera, and an IMU that is hit at every step\n"
    "  geoflow simulate parking -o bag --set scene.light_level=0.3 --set "
    "camera.depth_noise_scale=2\n"
    "      a darker place, a worse depth camera\n"
    "  geoflow simulate --list                                      scenes, presets and knobs\n"
    "  geoflow replay bag -o out && geoflow evaluate out/final_camera.txt bag/groundtruth.txt\n"
    "Files, truth and knobs: docs/simulator.md.";

/// `geoflow simulate SCENE -o DIR`.
class SimulateVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "simulate"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Make a recording of a simulated robot, with its exact truth";
  }
  [[nodiscard]] std::string_view examples() const override { return kExamples; }
  void declare(CLI::App& command) override;
  [[nodiscard]] Result<ExitCode> run(Console& console) override;

 private:
  [[nodiscard]] Result<simulator::SimulationOptions> options() const;
  [[nodiscard]] Result<ExitCode> make(Console& console) const;
  static void list(Console& console);

  std::string scene_;
  std::string output_;
  std::uint64_t seed_ = 1;
  double duration_s_ = simulator::SimulationOptions{}.duration_s;
  std::vector<std::string> presets_;
  std::vector<std::string> settings_;
  bool list_ = false;
  bool tum_ = false;
  bool gray_ = false;
  bool raw_ = false;
  bool reuse_ = false;
};

void SimulateVerb::declare(CLI::App& command) {
  command.add_option("SCENE", scene_, "Where to walk; --list tells what there is");
  command.add_option("-o,--output", output_, "Folder of the recording; must not exist");
  command.add_option("--seed", seed_, "Decides the place, the walk and all noise")
      ->capture_default_str();
  command.add_option("--duration", duration_s_, "Length of the recording [s]")
      ->check(CLI::Range(kShortestS, kLongestS).description(""))
      ->capture_default_str();
  command.add_option("--preset", presets_, "Several knobs at once, before --set; repeatable")
      ->allow_extra_args(false);
  command.add_option("--set", settings_, "Turns one knob, NAME=VALUE; repeatable")
      ->allow_extra_args(false);
  command.add_flag("--list", list_, "List scenes, presets and knobs");
  command.add_flag("--tum", tum_, "Also write a TUM RGB-D folder, OUTPUT/tum");
  command.add_flag("--gray", gray_, "Gray images instead of colour: a third of the size");
  command.add_flag("--raw", raw_, "Do not compress (compression is lossless)");
  command.add_flag("--reuse", reuse_,
                   "Keep a recording made with the same parameters; replace one with others");
}

Result<simulator::SimulationOptions> SimulateVerb::options() const {
  simulator::SimulationOptions options{.scene = scene_, .seed = seed_, .duration_s = duration_s_};
  options.camera.color_format = gray_ ? PixelFormat::kGray8 : PixelFormat::kBgr8;
  for (const std::string& preset : presets_) {
    if (auto applied = apply_preset(options, preset); !applied) {
      return tl::unexpected{std::move(applied.error())};
    }
  }
  for (const std::string& setting : settings_) {
    if (auto set = set_knob(options, setting); !set) {
      return tl::unexpected{std::move(set.error())};
    }
  }
  return options;
}

void SimulateVerb::list(Console& console) {
  nlohmann::json scenes = nlohmann::json::array();
  console.line("Scenes");
  for (const simulator::SceneInfo& scene : simulator::scenes()) {
    console.line("  {:18} {}", scene.name, scene.summary);
    scenes.push_back({{"name", scene.name}, {"summary", scene.summary}});
  }
  nlohmann::json all_presets = nlohmann::json::array();
  console.line("\nPresets (--preset NAME)");
  for (const Preset& preset : presets()) {
    console.line("  {:18} {}", preset.name, preset.summary);
    all_presets.push_back({{"name", preset.name}, {"summary", preset.summary}});
  }
  nlohmann::json knobs = nlohmann::json::array();
  console.line("\nKnobs (--set NAME=VALUE): default, range, unit");
  for (const simulator::KnobInfo& knob : all_knobs()) {
    console.line("  {:36} {:>8.6g}  {:.6g} to {:.6g} {}\n      {}", knob.name, knob.fallback,
                 knob.minimum, knob.maximum, knob.unit, knob.summary);
    knobs.push_back({{"name", knob.name},
                     {"unit", knob.unit},
                     {"summary", knob.summary},
                     {"default", knob.fallback},
                     {"minimum", knob.minimum},
                     {"maximum", knob.maximum},
                     {"whole", knob.whole}});
  }
  console.object({{"scenes", scenes}, {"presets", all_presets}, {"knobs", knobs}});
}

Result<ExitCode> SimulateVerb::make(Console& console) const {
  const auto chosen = options();
  if (!chosen) {
    return tl::unexpected{chosen.error()};
  }
  if (tum_ && chosen->recording.device_clocks) {
    return fail(ErrorCode::kInvalidArgument,
                "--tum: its files have one time line, so recording.device_clocks must be 0");
  }
  WriteOptions write{.directory = output_, .compress = !raw_, .tum = tum_};
  write.parameters = to_json(*chosen);
  write.parameters["version"] = std::string{daemon::version()};
  write.parameters["compressed"] = !raw_;
  write.parameters["tum"] = tum_;
  std::error_code error;
  const bool exists = std::filesystem::exists(output_, error);
  if (exists && reuse_ && is_same_simulation(output_, write.parameters)) {
    console.line("{} is there already", output_);
    console.object({{"output", output_}, {"reused", true}});
    return ExitCode::kOk;
  }
  simulator::keep_freed_memory();
  auto simulation = simulator::Simulation::create(*chosen);
  if (!simulation) {
    return tl::unexpected{std::move(simulation.error())};
  }
  if (auto removed = exists && reuse_ ? remove_simulation(output_) : Result<void>{}; !removed) {
    return tl::unexpected{std::move(removed.error())};
  }
  const InterruptScope interrupt;
  const HostTime begin = HostClock::now();
  const auto finished =
      write_simulation(**simulation, write, [&](std::size_t done, std::size_t total) {
        const double rate = static_cast<double>(done) / to_seconds(HostClock::now() - begin);
        console.progress(done, total, fmt::format("frames, {:.1f} a second", rate));
        return !InterruptScope::requested();
      });
  console.end_progress();
  if (!finished) {
    return tl::unexpected{finished.error()};
  }
  if (!*finished) {
    return ExitCode::kInterrupted;
  }
  console.line("{} frames in {:.1f} s, written to {}", (*simulation)->frames(),
               to_seconds(HostClock::now() - begin), output_);
  console.object({{"output", output_}, {"reused", false}, {"frames", (*simulation)->frames()}});
  return ExitCode::kOk;
}

Result<ExitCode> SimulateVerb::run(Console& console) {
  if (list_) {
    list(console);
    return ExitCode::kOk;
  }
  if (scene_.empty() || output_.empty()) {
    return fail(ErrorCode::kInvalidArgument,
                "a SCENE and -o FOLDER are needed; --list tells the scenes");
  }
  return make(console);
}

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_simulate_verb() {
  return std::make_unique<SimulateVerb>();
}

}  // namespace geoflow::tools
