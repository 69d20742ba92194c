#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "geoflow/daemon/config.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::daemon {

/// What geoflowd's command line says; it overrides the configuration file.
struct CommandLine {
  std::string config_file;
  std::string replay;
  std::string calibration;
  std::string faults;
  std::optional<std::uint64_t> fault_seed;
  bool realtime = false;
  bool fast = false;
  bool loop = false;
  std::optional<std::string> pose_socket;
  std::optional<std::string> control_socket;
  std::vector<std::string> settings;  ///< section.key=value
  bool verbose = false;
};

/// The command line, or the exit code where --help or --version was asked for or it is wrong (then
/// it has been said).
[[nodiscard]] std::variant<CommandLine, ExitCode> parse_command_line(int argc,
                                                                     const char* const* argv);

/// The configuration that results: defaults, file, settings, options, in that order.
[[nodiscard]] Result<Config> make_config(const CommandLine& command_line);

}  // namespace geoflow::daemon
