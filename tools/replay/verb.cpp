#include "geoflow/tools/verb.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/App.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/core.hpp"
#include "geoflow/slam/saved_map.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/interrupt.hpp"
#include "geoflow/tools/output_files.hpp"

#include "replay/outputs.hpp"
#include "replay/report.hpp"
#include "replay/session.hpp"

namespace geoflow::tools {
namespace {

class ReplayVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "replay"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Run a recording through the estimator; write trajectories and a report";
  }
  [[nodiscard]] std::string_view examples() const override {
    return "  geoflow replay kitchen-400 -o out                          trajectories to out/, as "
           "TUM text\n"
           "  geoflow replay bag -o out --calibration calib --json        the report on standard "
           "output as well\n"
           "  geoflow replay bag -o out --faults drops.yaml --seed 7      with faults, the same "
           "ones each time\n"
           "  geoflow replay bag -o out --set slam.switches.gicp=false    without one of the "
           "estimator's parts\n"
           "  geoflow replay bag -o out --load-map a.map --save-map b.map in a map, kept\n"
           "The keys of report.json: docs/cli.md. Those of --set: config/geoflow.toml.";
  }

  void declare(CLI::App& command) override {
    command
        .add_option("recording", recording_,
                    "TUM RGB-D, rosbag2, OpenLORIS or EuRoC folder, or .sens file")
        ->required();
    command.add_option("-o,--output", output_, "Folder for the results; made if it is not there")
        ->required();
    command.add_option("--calibration", calibration_, "Folder with Kalibr files");
    command.add_option("--config", config_file_, "TOML file");
    command.add_option("--faults", faults_, "Script of faults to put on the recording");
    command.add_option("--seed", seed_, "Seed of the script's random choices");
    command.add_flag("--imu-poses", imu_poses_,
                     "Also write live_imu_base.txt: base_link at each IMU sample, carried on from "
                     "the newest frame");
    command.add_option("--load-map", load_map_, "Begin with this map, and find the place in it");
    command.add_option("--save-map", save_map_, "Write the map to this file at the end");
    command
        .add_option("--set", settings_,
                    "Overrides one key of the configuration, section.key=value; repeatable")
        ->allow_extra_args(false);
  }

  [[nodiscard]] Result<ExitCode> run(Console& console) override {
    auto config = make_config();
    if (!config) {
      return tl::unexpected{std::move(config.error())};
    }
    const InterruptScope interrupt;
    auto prepared = prepare_output(output_);
    if (!prepared) {
      return tl::unexpected{std::move(prepared.error())};
    }
    const HostTime begin = HostClock::now();
    const auto progress = [&](std::uint64_t frames, std::uint64_t total) {
      const double rate = static_cast<double>(frames) / to_seconds(HostClock::now() - begin);
      console.progress(frames, total, fmt::format("frames, {:.0f} a second", rate));
      return !InterruptScope::requested();
    };
    auto result = replay(*config, progress, imu_poses_);
    if (!result) {
      return tl::unexpected{std::move(result.error())};
    }
    console.end_progress();
    return finish(*result, *config, console);
  }

 private:
  [[nodiscard]] Result<daemon::Config> make_config() const {
    auto config = daemon::configure(config_file_, settings_);
    if (config) {
      config->source = {.replay = recording_,
                        .calibration = calibration_,
                        .faults = faults_,
                        .fault_seed = seed_,
                        .realtime = false};
      config->map.file = load_map_;
    }
    return config;
  }

  [[nodiscard]] Result<ExitCode> finish(const ReplayResult& result, const daemon::Config& config,
                                        Console& console) const {
    const nlohmann::json report = make_report(result, config);
    auto written = write_outputs(output_, result, report);
    if (written && !save_map_.empty()) {
      written = slam::save_map(*result.run.core->snapshot(), save_map_);
    }
    if (!written) {
      return tl::unexpected{std::move(written.error())};
    }
    console.object(report);
    const daemon::RunStatistics& statistics = *result.run.statistics;
    console.line(
        "{} frames, {} tracked, {:.1f} frames/s ({:.1f} without decoding), peak memory {:.0f} MiB",
        statistics.frames(), statistics.frames_with_pose(),
        report["speed"]["frames_per_s"].get<double>(),
        report["speed"]["frames_per_s_without_decoding"].get<double>(), daemon::peak_memory_mib());
    if (const std::uint64_t rejected = statistics.counters.rejected.load(); rejected > 0) {
      console.line("{} samples could not be read; the last: {}", rejected,
                   result.run.streams->recent_errors().back());
    }
    console.line("calibration: {}", result.run.streams->calibration().source);
    console.line(
        "written to {}: live_camera.txt live_base.txt final_camera.txt final_base.txt "
        "estimates.csv report.json",
        output_);
    return result.interrupted ? ExitCode::kInterrupted : ExitCode::kOk;
  }

  std::string recording_;
  std::string output_;
  std::string calibration_;
  std::string config_file_;
  std::string faults_;
  std::string load_map_;
  std::string save_map_;
  std::uint64_t seed_ = 0;
  bool imu_poses_ = false;
  std::vector<std::string> settings_;
};

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_replay_verb() {
  return std::make_unique<ReplayVerb>();
}

}  // namespace geoflow::tools
