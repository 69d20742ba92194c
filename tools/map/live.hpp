#pragma once

#include <CLI/App.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/live_client.hpp"

namespace geoflow::tools {

/// `geoflow map save` and `geoflow map reset`: the running daemon's map. Thread-bound.
class LiveMap {
 public:
  void declare(CLI::App& command);
  [[nodiscard]] bool parsed() const { return save_->parsed() || reset_->parsed(); }
  [[nodiscard]] Result<ExitCode> run(Console& console);

 private:
  LiveClient daemon_;
  CLI::App* save_ = nullptr;
  CLI::App* reset_ = nullptr;
};

}  // namespace geoflow::tools
