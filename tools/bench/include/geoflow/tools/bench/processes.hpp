#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"

/// Programs run as processes of their own, several at a time.
namespace geoflow::tools {

struct Command {
  std::vector<std::string> arguments;  ///< the program's path first
  /// Gets what the program says; empty: its standard output is discarded, its standard error kept.
  std::filesystem::path log{};
};

/// How a process ended.
struct Ended {
  int exit_code = -1;  ///< -1 where it did not run to its end
  int signal = 0;      ///< that ended it; 0: none

  [[nodiscard]] bool well() const noexcept { return exit_code == 0; }
  /// "exit code 3" or "signal 9".
  [[nodiscard]] std::string how() const;
};

/// Asked after each process's end, and when a signal came: whether to go on. Gets how many have
/// ended.
using GoOn = std::function<bool(std::size_t done)>;

/// Runs all commands in their order, at most `at_a_time` (>= 1) at once, and waits for them. Once
/// `go_on` says false, no more are started and those that run get SIGTERM; what was not run to its
/// end has no exit code. An Error: one cannot be started, by its name (those that run are ended).
/// Thread-bound.
[[nodiscard]] Result<std::vector<Ended>> run_processes(std::span<const Command> commands,
                                                       std::size_t at_a_time, const GoOn& go_on);

/// The command as a shell takes it, words quoted where they need it. Pure.
[[nodiscard]] std::string shell_line(const std::vector<std::string>& arguments);

/// This program's own file. Errors: /proc cannot be read.
[[nodiscard]] Result<std::filesystem::path> own_program();

}  // namespace geoflow::tools
