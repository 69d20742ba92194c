#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/table.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "bench/suite/ablation.hpp"
#include "bench/suite/sequences.hpp"

/// What one configuration did on one sequence, and tables of that.
namespace geoflow::tools {

/// How a run is judged.
struct JudgeOptions {
  double correct_within_m = 1.0;  ///< a pose counts for the correct rate up to this error
};

/// One run. What was not measured is not a number.
struct Outcome {
  std::string sequence;
  std::string row;
  std::string failure;      ///< a sentence; empty where the run succeeded
  double ate_m = 0;         ///< RMSE after SE(3) alignment, of the final trajectory
  double rte_m = 0;         ///< RMSE of the relative motion over one frame
  double correct_rate = 0;  ///< 0 to 1, of the reference's time
  double coverage = 0;      ///< the same whatever the error
  double frame_ms = 0;      ///< mean time of the estimator for a frame
  double frames = 0;
  double tracked = 0;
};

/// Judges what `geoflow replay` left in `output` against the sequence's truth during the recording.
/// A run that left nothing, cannot be laid over the truth, or vouches for less than half of the
/// reference's time with poses within JudgeOptions::correct_within_m has failed. Definitions:
/// docs/evaluate.md.
[[nodiscard]] Outcome judge(const Sequence& sequence, const std::string& row,
                            const Result<TrajectoryFile>& truth,
                            const std::filesystem::path& output, const JudgeOptions& options);

/// One line a run: the figures, what the paper says of the whole method there, and the failure.
/// Pure.
[[nodiscard]] BenchTable sequence_table(Suite suite, const std::vector<Outcome>& outcomes);

/// One line for each row and set: how many sequences and failures, and the means over those that
/// succeeded. Sets: all that were found, and `table III` where all its sequences were. Pure.
[[nodiscard]] BenchTable summary_table(Suite suite, const std::vector<Outcome>& outcomes);

}  // namespace geoflow::tools
