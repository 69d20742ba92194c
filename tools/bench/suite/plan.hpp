#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/processes.hpp"

#include "bench/suite/ablation.hpp"
#include "bench/suite/sequences.hpp"

/// Which commands a table is made of.
namespace geoflow::tools {

/// One configuration on one sequence.
struct Run {
  const Sequence* sequence = nullptr;
  const AblationRow* row = nullptr;
  std::filesystem::path output;  ///< its folder: what `geoflow replay` writes, and log.txt
  std::vector<std::string> arguments;
};

struct PlanOptions {
  std::filesystem::path program;      ///< the `geoflow` command
  std::filesystem::path output;       ///< each run has SEQUENCE/ROW in it
  std::vector<std::string> settings;  ///< `--set` of every run, before the row's own
};

/// Every row on every sequence, sequences outermost. The runs refer to the two lists. Pure.
[[nodiscard]] std::vector<Run> plan_runs(const std::vector<Sequence>& sequences,
                                         const std::vector<AblationRow>& rows,
                                         const PlanOptions& options);

/// The command of a run, its folder made empty for it: what an earlier run left must not stand for
/// this one. Errors: the folder cannot be made.
[[nodiscard]] Result<Command> prepare(const Run& run);

}  // namespace geoflow::tools
