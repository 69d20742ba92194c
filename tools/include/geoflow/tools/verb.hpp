#pragma once

#include <string_view>

#include <CLI/App.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"

namespace geoflow::tools {

/// One verb of the `geoflow` command. `--json` and `--help` are declared for every verb by the
/// caller; the help ends with `examples()`. Thread-bound.
class Verb {
 public:
  Verb() = default;
  Verb(const Verb&) = delete;
  Verb& operator=(const Verb&) = delete;
  virtual ~Verb() = default;

  /// The word after `geoflow`.
  [[nodiscard]] virtual std::string_view name() const = 0;
  /// One line for the list of verbs.
  [[nodiscard]] virtual std::string_view summary() const = 0;
  /// Command lines that work as they stand, one a line, each with a word on what it does.
  [[nodiscard]] virtual std::string_view examples() const = 0;
  /// Declares options and arguments on the verb's own subcommand; they are bound to members.
  virtual void declare(CLI::App& command) = 0;
  /// Does the work. An error is printed by the caller (as a JSON object under `--json`) and becomes
  /// the exit code.
  [[nodiscard]] virtual Result<ExitCode> run(Console& console) = 0;
};

}  // namespace geoflow::tools
