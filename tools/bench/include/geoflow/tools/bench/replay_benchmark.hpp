#pragma once

#include <filesystem>
#include <vector>

#include <nlohmann/json.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/table.hpp"

namespace geoflow::tools {

struct ReplayBenchmarkOptions {
  std::filesystem::path program;  ///< the `geoflow` command that is measured
  std::filesystem::path recording;
  std::filesystem::path calibration{};  ///< folder; empty: found in the recording
  int runs = 3;                         ///< 1 to 1000
};

/// What one run left behind.
struct ReplayRun {
  double wall_s = 0;  ///< from the start of the process to its end
  nlohmann::json report;
};

/// Runs `program replay recording` as a process of its own, once for each row, so that start-up and
/// memory are those of a user's run. Blocks. Errors: the program cannot be started, fails, or
/// writes no report.
[[nodiscard]] Result<BenchTable> run_replay_benchmark(const ReplayBenchmarkOptions& options);

/// One row for each run: frames, frames/s, memory, wall time, then the mean time of each stage that
/// the reports name
/// ("times_ms"). Numbers that a report lacks are left out of its row. Pure.
[[nodiscard]] BenchTable replay_table(const std::vector<ReplayRun>& runs);

}  // namespace geoflow::tools
