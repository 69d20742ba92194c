#pragma once

#include <string>

#include <CLI/App.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"

namespace geoflow::tools {

/// `geoflow map ls [FOLDER]`: the maps in a folder. Thread-bound.
class MapList {
 public:
  void declare(CLI::App& command);
  [[nodiscard]] bool parsed() const { return command_->parsed(); }
  /// kNotFound, kSystem where the folder cannot be read. A damaged map is shown as such; what is no
  /// map is left out.
  [[nodiscard]] Result<ExitCode> run(Console& console) const;

 private:
  CLI::App* command_ = nullptr;
  std::string folder_ = "/var/lib/geoflow";
};

}  // namespace geoflow::tools
