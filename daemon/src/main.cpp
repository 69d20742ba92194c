#include <cstdio>
#include <variant>

#include <fmt/core.h>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/daemon.hpp"
#include "geoflow/hal/exit_code.hpp"

#include "src/command_line.hpp"

int main(int argc, char** argv) {
  using namespace geoflow;
  const auto parsed = daemon::parse_command_line(argc, argv);
  if (const auto* exit = std::get_if<ExitCode>(&parsed)) {
    return static_cast<int>(*exit);
  }
  const auto read_config = [&line = std::get<daemon::CommandLine>(parsed)] {
    return daemon::make_config(line);
  };
  const auto config = read_config();
  const auto done = config.and_then(
      [&](const daemon::Config& ready) { return daemon::run_daemon(ready, read_config); });
  if (!done) {
    fmt::print(stderr, "geoflowd: {}\n", done.error().message);
    return static_cast<int>(exit_code(done.error()));
  }
  return static_cast<int>(*done);
}
