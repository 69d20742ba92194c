#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/association.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {

struct EvaluationOptions {
  AssociationOptions association{};
  Alignment alignment = Alignment::kSe3;
  RelativeOptions relative{};
  CoverageOptions coverage{};
};

/// Statistics of translations [m] and rotations [deg].
struct ErrorStatistics {
  Statistics translation_m;
  Statistics rotation_deg;
};

/// All that is said of one estimate.
struct Evaluation {
  PosePairs pairs;       ///< aligned
  Similarity alignment;  ///< by which the estimates were moved
  PoseErrors absolute;   ///< one for each of `pairs`
  IndexPairs stretches;  ///< into `pairs`
  PoseErrors relative;   ///< one for each of `stretches`
  ErrorStatistics ate;
  ErrorStatistics rpe;  ///< all zero where `stretches` is empty
  PathLengths path;
  double coverage =
      0;  ///< fraction of the reference's time span with estimates, whatever their error
  std::optional<double> correct_rate{};  ///< where an error bound was given
  bool timed = true;  ///< false for KITTI files: their times only count poses, one a second
  std::vector<std::string> warnings;
};

/// Associates, aligns and measures. Pure. Errors as in associate(), align() and stretches().
[[nodiscard]] Result<Evaluation> evaluate(const TrajectoryFile& estimate,
                                          const TrajectoryFile& reference,
                                          const EvaluationOptions& options);

/// The JSON object that docs/evaluate.md documents, without the names of files.
[[nodiscard]] nlohmann::json to_json(const Evaluation& evaluation,
                                     const EvaluationOptions& options);

}  // namespace geoflow::tools
