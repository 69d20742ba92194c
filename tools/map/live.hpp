#pragma once

#include <string>

#include <CLI/App.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/live_client.hpp"

namespace geoflow::tools {

/// `geoflow map save`, `geoflow map load FILE` and `geoflow map reset`: the running daemon's map.
/// Thread-bound.
class LiveMap {
 public:
  void declare(CLI::App& command);
  [[nodiscard]] bool parsed() const {
    return save_->parsed() || load_->parsed() || reset_->parsed();
  }
  [[nodiscard]] Result<ExitCode> run(Console& console);

 private:
  [[nodiscard]] Result<void> save(Console& console);
  [[nodiscard]] Result<void> load(Console& console);
  [[nodiscard]] Result<void> reset(Console& console);

  LiveClient daemon_;
  CLI::App* save_ = nullptr;
  CLI::App* load_ = nullptr;
  std::string file_;
  CLI::App* reset_ = nullptr;
};

}  // namespace geoflow::tools
