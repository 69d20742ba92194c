#include "geoflow/tools/verb.hpp"

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/estimate_table.hpp"
#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/association.hpp"
#include "geoflow/tools/evaluate/consistency.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/plot.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "evaluate/figure.hpp"
#include "evaluate/report.hpp"
#include "evaluate/table.hpp"

namespace geoflow::tools {
namespace {

constexpr std::string_view kCategory = "evaluate";
/// Seconds that any option may hold: more would not fit the integer nanoseconds.
constexpr double kMaxSeconds = 1e8;

void warn(const Evaluation& evaluation) {
  for (const std::string& warning : evaluation.warnings) {
    log::warning(kCategory, "{}", warning);
  }
}

/// `geoflow evaluate ESTIMATE REFERENCE`.
class EvaluateVerb final : public Verb {
 public:
  [[nodiscard]] std::string_view name() const override { return "evaluate"; }
  [[nodiscard]] std::string_view summary() const override {
    return "Say how far a trajectory is from the truth (ATE, RPE, coverage), with a plot";
  }
  [[nodiscard]] std::string_view examples() const override;
  void declare(CLI::App& command) override;
  [[nodiscard]] Result<ExitCode> run(Console& console) override;

 private:
  void declare_relative(CLI::App& command);
  [[nodiscard]] EvaluationOptions options() const;
  [[nodiscard]] Result<Evaluation> measure(Console& console,
                                           const EvaluationOptions& options) const;
  [[nodiscard]] Result<std::optional<Consistency>> measure_consistency(
      const TrajectoryFile& reference, const EvaluationOptions& options) const;
  [[nodiscard]] Result<void> write_files(const Evaluation& evaluation,
                                         const EvaluationOptions& options) const;
  [[nodiscard]] ExitCode judge(const Evaluation& evaluation) const;

  std::string estimate_;
  std::string reference_;
  std::optional<TrajectoryFormat> format_;
  double max_difference_s_ = to_seconds(AssociationOptions{}.max_difference);
  double offset_s_ = 0;
  double max_gap_s_ = to_seconds(CoverageOptions{}.max_gap);
  EvaluationOptions options_;
  std::string estimates_;
  std::string plot_;
  std::string table_;
  std::optional<double> max_ate_m_;
};

std::string_view EvaluateVerb::examples() const {
  return "  geoflow evaluate out/final_camera.txt groundtruth.txt\n"
         "      ATE after SE(3) alignment, relative error over 1 s\n"
         "  geoflow evaluate out/final_camera.txt groundtruth.txt --plot error.png --table "
         "error.csv\n"
         "      the same with a figure and a line of CSV for each pose\n"
         "  geoflow evaluate estimate.txt 00.txt --align none --delta 10 --unit m\n"
         "      KITTI files, drift over 10 m\n"
         "  geoflow evaluate estimate.txt truth.csv --align sim3 --max-difference 0.02 --offset "
         "-0.1\n"
         "      a monocular estimate whose clock is 0.1 s ahead\n"
         "  geoflow evaluate out/live_base.txt groundtruth_base.txt --estimates out/estimates.csv\n"
         "      and whether the errors are what the covariances say\n"
         "  geoflow evaluate out/final_camera.txt groundtruth.txt --max-ate 0.05 --json\n"
         "      for scripts: exit code 1 where the ATE is above 0.05 m";
}

void EvaluateVerb::declare(CLI::App& command) {
  const std::map<std::string, Alignment> alignments{{"none", Alignment::kNone},
                                                    {"origin", Alignment::kOrigin},
                                                    {"se3", Alignment::kSe3},
                                                    {"sim3", Alignment::kSim3}};
  const std::map<std::string, TrajectoryFormat> formats{{"tum", TrajectoryFormat::kTum},
                                                        {"kitti", TrajectoryFormat::kKitti},
                                                        {"euroc", TrajectoryFormat::kEuroc}};
  const CLI::Range seconds{0.0, kMaxSeconds};
  command.add_option("ESTIMATE", estimate_, "Trajectory to judge (TUM, KITTI or EuRoC form)")
      ->required();
  command.add_option("REFERENCE", reference_, "True trajectory, in any of these forms")->required();
  command
      .add_option("--format", format_,
                  "Form of both files: tum, kitti or euroc (default: seen from the file)")
      ->transform(CLI::CheckedTransformer(formats).description(""));
  command
      .add_option("--align", options_.alignment,
                  "Lay the estimate over the reference: se3 (default), sim3, origin or none")
      ->transform(CLI::CheckedTransformer(alignments).description(""));
  command
      .add_option("--max-difference", max_difference_s_, "Largest time between paired poses [s]")
      ->check(seconds)
      ->capture_default_str();
  command.add_option("--offset", offset_s_, "Added to the estimate's times [s]")
      ->check(CLI::Range(-kMaxSeconds, kMaxSeconds))
      ->capture_default_str();
  declare_relative(command);
  command
      .add_option("--max-gap", max_gap_s_,
                  "Time for which one pose vouches at most, for the coverage [s]")
      ->check(seconds)
      ->capture_default_str();
  command.add_option("--correct-within", options_.coverage.max_error_m,
                     "Also say for how much of the time the position was within this [m]");
  command.add_option("--estimates", estimates_,
                     "Also say how honest the covariances in this estimates.csv of geoflow replay "
                     "are (NEES)");
  command.add_option("--plot", plot_, "Draw paths and errors to this file, .png or .svg");
  command.add_option("--table", table_, "Write every pose's error to this file as CSV");
  command.add_option("--max-ate", max_ate_m_,
                     "Exit with code 1 where the ATE (RMSE) is above this [m]");
}

void EvaluateVerb::declare_relative(CLI::App& command) {
  const std::map<std::string, DeltaUnit> units{{"frames", DeltaUnit::kFrames},
                                               {"m", DeltaUnit::kMetres},
                                               {"s", DeltaUnit::kSeconds},
                                               {"deg", DeltaUnit::kDegrees}};
  command
      .add_option("--delta", options_.relative.delta,
                  "Length of the stretches for the relative error")
      ->capture_default_str();
  command
      .add_option("--unit", options_.relative.unit,
                  "Unit of --delta: s (default), m, frames or deg")
      ->transform(CLI::CheckedTransformer(units).description(""));
  command.add_flag("--all-pairs", options_.relative.all_pairs,
                   "Take a stretch from every pose, not end to end");
  command
      .add_option("--delta-tolerance", options_.relative.tolerance,
                  "How far a stretch may be from --delta, as a fraction of it")
      ->capture_default_str();
}

EvaluationOptions EvaluateVerb::options() const {
  EvaluationOptions options = options_;
  options.association.max_difference = from_seconds(max_difference_s_);
  options.association.offset = from_seconds(offset_s_);
  options.coverage.max_gap = from_seconds(max_gap_s_);
  return options;
}

Result<Evaluation> EvaluateVerb::measure(Console& console, const EvaluationOptions& options) const {
  const auto estimate = read_trajectory(estimate_, format_);
  if (!estimate) {
    return tl::unexpected{estimate.error()};
  }
  const auto reference = read_trajectory(reference_, format_);
  if (!reference) {
    return tl::unexpected{reference.error()};
  }
  const auto consistency = measure_consistency(*reference, options);
  if (!consistency) {
    return tl::unexpected{consistency.error()};
  }
  auto evaluation = evaluate(*estimate, *reference, options);
  if (evaluation) {
    nlohmann::json object = to_json(*evaluation, options);
    object["estimate"] = {{"path", estimate_},
                          {"format", to_string(estimate->format)},
                          {"poses", estimate->poses.size()}};
    object["reference"] = {{"path", reference_},
                           {"format", to_string(reference->format)},
                           {"poses", reference->poses.size()}};
    const std::optional<Consistency>& honest = *consistency;
    if (honest) {
      object["consistency"] = to_json(*honest);
    }
    console.object(object);
    console.line("estimate   {} ({} poses)", estimate_, estimate->poses.size());
    console.line("reference  {} ({} poses)", reference_, reference->poses.size());
    print_report(console, *evaluation, options);
    if (honest) {
      print_consistency(console, *honest);
    }
  }
  return evaluation;
}

Result<std::optional<Consistency>> EvaluateVerb::measure_consistency(
    const TrajectoryFile& reference, const EvaluationOptions& options) const {
  if (estimates_.empty()) {
    return std::nullopt;
  }
  return read_estimates(estimates_)
      .and_then([&](const std::vector<PoseEstimate>& estimates) {
        return normalised_errors(estimates, reference.poses, options.association);
      })
      .map([](const std::vector<NormalisedError>& errors) {
        return std::optional{consistency(errors)};
      });
}

Result<void> EvaluateVerb::write_files(const Evaluation& evaluation,
                                       const EvaluationOptions& options) const {
  if (!table_.empty()) {
    if (auto written = write_error_table(evaluation, table_); !written) {
      return written;
    }
  }
  if (!plot_.empty()) {
    const std::string title =
        fmt::format("{} against {}", std::filesystem::path{estimate_}.filename().string(),
                    std::filesystem::path{reference_}.filename().string());
    return save_figure(evaluation_figure(evaluation, options, title), plot_);
  }
  return {};
}

ExitCode EvaluateVerb::judge(const Evaluation& evaluation) const {
  if (max_ate_m_ && !(evaluation.ate.translation_m.rmse <= *max_ate_m_)) {
    log::error(kCategory, "the ATE of {:.6f} m is above {} m", evaluation.ate.translation_m.rmse,
               *max_ate_m_);
    return ExitCode::kFailure;
  }
  return ExitCode::kOk;
}

Result<ExitCode> EvaluateVerb::run(Console& console) {
  const EvaluationOptions chosen = options();
  return measure(console, chosen).and_then([&](const Evaluation& evaluation) -> Result<ExitCode> {
    warn(evaluation);
    return write_files(evaluation, chosen).map([&] { return judge(evaluation); });
  });
}

}  // namespace

// NOLINTNEXTLINE(misc-use-internal-linkage): called by the generated list of verbs
std::unique_ptr<Verb> make_evaluate_verb() {
  return std::make_unique<EvaluateVerb>();
}

}  // namespace geoflow::tools
