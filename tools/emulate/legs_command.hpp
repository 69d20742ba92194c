#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <CLI/App.hpp>

#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/drivers/leg_emitter.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/console.hpp"

#include "emulate/leg_sources.hpp"

namespace geoflow::tools {

/// `geoflow emulate legs`: a robot's legs on CAN or DDS.
class LegsCommand {
 public:
  void declare(CLI::App& command);
  [[nodiscard]] Result<ExitCode> run(Console& console) const;
  [[nodiscard]] static std::string_view examples() noexcept;

 private:
  [[nodiscard]] Result<std::unique_ptr<drivers::LegEmitter>> open() const;
  [[nodiscard]] std::optional<Duration> shift() const;

  std::string can_;
  std::filesystem::path dictionary_;
  bool fd_ = false;
  std::string dds_;
  int domain_ = 0;
  std::filesystem::path recording_;
  std::optional<std::int64_t> shift_ns_;
  bool simulate_ = false;
  bool loop_ = false;
  SimulatedLegs simulated_;
};

}  // namespace geoflow::tools
