#include "src/command_line.hpp"

#include <filesystem>
#include <string>
#include <variant>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Error.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/core.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/version.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {
namespace {

constexpr const char* kFooter = R"(Examples:
  geoflowd --replay kitchen-400                       a recording at its own pace, on /run/geoflow/*.sock
  geoflowd --config config/geoflow.toml --replay bag --fast
  geoflowd --replay bag --loop --pose-socket /tmp/pose.sock --control-socket /tmp/ctl.sock
  geoflow pose --socket /tmp/pose.sock                what it then says, in another terminal
Exit codes: 0 done or stopped by SIGINT or SIGTERM, 1 failure, 2 usage or configuration, 3 bad recording or calibration,
4 another daemon holds the sockets. The configuration's keys: config/geoflow.toml. The sockets: docs/protocol.md.)";

void declare(CLI::App& app, CommandLine& line) {
  app.add_option("--config", line.config_file, "TOML file; without it the defaults hold")
      ->type_name("FILE");
  app.add_option("--replay", line.replay, "Recording to replay")->type_name("DIR");
  app.add_option("--calibration", line.calibration, "Folder with Kalibr files")->type_name("DIR");
  app.add_option("--faults", line.faults, "Script of faults to put on the recording")
      ->type_name("FILE");
  app.add_option("--fault-seed", line.fault_seed, "Seed of the script's random choices")
      ->type_name("N");
  auto* realtime = app.add_flag("--realtime", line.realtime,
                                "At the pace it was recorded, with all threads (default)");
  app.add_flag("--fast", line.fast, "As fast as it goes, in lock step: deterministic")
      ->excludes(realtime);
  app.add_flag("--loop", line.loop, "Begin again at the recording's end");
  app.add_option("--pose-socket", line.pose_socket, "Path of the pose socket; empty: none")
      ->type_name("PATH");
  app.add_option("--control-socket,--ctl-socket", line.control_socket,
                 "Path of the control socket; empty: none")
      ->type_name("PATH");
  app.add_option("--set", line.settings, "Overrides one key of the configuration; repeatable")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  app.add_flag("--verbose", line.verbose, "Log details");
  app.footer(kFooter);
  app.set_version_flag("--version", fmt::format("geoflowd {}", version()));
}

void apply_options(const CommandLine& line, Config& config) {
  const auto set_if_given = [](const std::string& value, std::filesystem::path& target) {
    if (!value.empty()) {
      target = value;
    }
  };
  set_if_given(line.replay, config.source.replay);
  set_if_given(line.calibration, config.source.calibration);
  set_if_given(line.faults, config.source.faults);
  config.source.fault_seed = line.fault_seed.value_or(config.source.fault_seed);
  config.source.realtime = line.realtime || (config.source.realtime && !line.fast);
  config.source.loop = config.source.loop || line.loop;
  config.socket.pose = line.pose_socket.value_or(config.socket.pose.string());
  config.socket.control = line.control_socket.value_or(config.socket.control.string());
}

}  // namespace

std::variant<CommandLine, ExitCode> parse_command_line(int argc, const char* const* argv) {
  CLI::App app{"Tells where the robot is, on a Unix socket, from its camera or a recording.",
               "geoflowd"};
  CommandLine line;
  declare(app, line);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? ExitCode::kOk : ExitCode::kUsage;
  }
  if (line.verbose) {
    log::set_level(log::Level::kDebug);
  }
  return line;
}

Result<Config> make_config(const CommandLine& command_line) {
  auto config = configure(command_line.config_file, command_line.settings);
  if (config) {
    apply_options(command_line, *config);
  }
  return config;
}

}  // namespace geoflow::daemon
