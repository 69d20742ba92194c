#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/evaluate/consistency.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/plot.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "bench/suite/sequences.hpp"
#include "report/run_directory.hpp"

/// A run beside the truth.
namespace geoflow::tools {

/// A true trajectory and whose it is.
struct Reference {
  TrajectoryFile trajectory;
  ReferenceFrame frame = ReferenceFrame::kCamera;
  std::string name;  ///< of the file or recording
};

/// Reads the truth that was named: a file called groundtruth_base.txt is base_link's, any other the
/// camera's unless `frame` says otherwise. Errors as read_trajectory().
[[nodiscard]] Result<Reference> read_named_reference(const std::filesystem::path& file,
                                                     std::optional<ReferenceFrame> frame);

/// The truth that lies with a recording, as sequence_at() knows it; none where there is none.
/// Errors as read_reference().
[[nodiscard]] Result<std::optional<Reference>> find_reference(
    const std::filesystem::path& recording);

/// How far a run is from the truth, as `geoflow evaluate` measures it with its defaults.
struct Accuracy {
  EvaluationOptions options{};
  std::string reference;
  Evaluation live{};
  Evaluation last{};  ///< after all optimisation
  /// Beside the covariances; the error where there are none to compare with.
  Result<std::vector<NormalisedError>> normalised{};
};

/// Errors as evaluate().
[[nodiscard]] Result<Accuracy> measure_accuracy(const RunDirectory& run,
                                                const Reference& reference);

/// The relative errors of both trajectories at the times at which their stretches begin.
[[nodiscard]] Figure relative_error_figure(const Accuracy& accuracy);

/// Errors in the base's axes between three standard deviations, and their NEES. A precondition: at
/// least one error.
[[nodiscard]] Figure consistency_figure(const std::vector<NormalisedError>& errors);

}  // namespace geoflow::tools
