#include "bench/suite/outcome.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/bench/table.hpp"
#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/evaluate/pose_errors.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "bench/suite/published.hpp"
#include "bench/suite/sequences.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::literals::operator""_json_pointer;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
/// As the TUM benchmark's tools pair poses.
constexpr Duration kMaxDifference = std::chrono::milliseconds{20};

EvaluationOptions evaluation_options(const JudgeOptions& options) {
  EvaluationOptions evaluation;
  evaluation.association.max_difference = kMaxDifference;
  evaluation.alignment = Alignment::kSe3;
  evaluation.relative = {.delta = 1, .unit = DeltaUnit::kFrames, .all_pairs = true};
  evaluation.coverage.max_error_m = options.correct_within_m;
  return evaluation;
}

nlohmann::json read_report(const std::filesystem::path& file) {
  std::ifstream stream{file};
  return nlohmann::json::parse(stream, nullptr, false);
}

/// The number at a place of a report; not a number where there is none.
double number(const nlohmann::json& report, const nlohmann::json::json_pointer& place) {
  return report.is_object() && report.contains(place) && report.at(place).is_number()
             ? report.at(place).get<double>()
             : kNone;
}

/// The truth for the time of the recording: motion capture runs on before and after it.
TrajectoryFile during(const nlohmann::json& report, TrajectoryFile truth) {
  const double start_ns = number(report, "/input/start_ns"_json_pointer);
  const double end_ns = number(report, "/input/end_ns"_json_pointer);
  std::erase_if(truth.poses, [&](const StampedPose& pose) {
    const auto t_ns = static_cast<double>(pose.t.time_since_epoch().count());
    const auto margin_ns = static_cast<double>(kMaxDifference.count());
    return t_ns < start_ns - margin_ns || t_ns > end_ns + margin_ns;
  });
  return truth;
}

/// The last line of the run's log, for people.
std::string last_line(const std::filesystem::path& log) {
  std::ifstream stream{log};
  std::string last;
  for (std::string line; std::getline(stream, line);) {
    last = line.empty() ? last : line;
  }
  return last.empty() ? "no result" : last;
}

double mean(const std::vector<const Outcome*>& outcomes, double Outcome::* figure) {
  double sum = 0;
  for (const Outcome* outcome : outcomes) {
    sum += outcome->*figure;
  }
  return outcomes.empty() ? kNone : sum / static_cast<double>(outcomes.size());
}

bool in_table_iii(Suite suite, const Outcome& outcome) {
  const PublishedSequence* published = find_published(to_string(suite), outcome.sequence);
  return published != nullptr && published->in_table_iii;
}

void add_means(Suite suite, std::string_view set, const std::string& row,
               const std::vector<const Outcome*>& outcomes, BenchTable& table) {
  std::vector<const Outcome*> succeeded;
  std::ranges::copy_if(outcomes, std::back_inserter(succeeded),
                       [](const Outcome* outcome) { return outcome->failure.empty(); });
  const PublishedMean* published =
      set == "all" ? nullptr : find_published_mean(to_string(suite), row);
  const auto count = static_cast<std::int64_t>(outcomes.size());
  table.rows.push_back(
      {std::string{set}, row, count, count - static_cast<std::int64_t>(succeeded.size()),
       mean(succeeded, &Outcome::ate_m), mean(succeeded, &Outcome::rte_m),
       mean(succeeded, &Outcome::correct_rate), mean(succeeded, &Outcome::frame_ms),
       published != nullptr ? published->ate_m : kNone,
       published != nullptr ? published->rte_m : kNone});
}

template <typename Condition>
std::vector<const Outcome*> those_where(const std::vector<Outcome>& outcomes,
                                        const Condition& condition) {
  std::vector<const Outcome*> chosen;
  for (const Outcome& outcome : outcomes) {
    if (condition(outcome)) {
      chosen.push_back(&outcome);
    }
  }
  return chosen;
}

}  // namespace

Outcome judge(const Sequence& sequence, const std::string& row, const Result<TrajectoryFile>& truth,
              const std::filesystem::path& output, const JudgeOptions& options) {
  Outcome outcome{.sequence = sequence.name,
                  .row = row,
                  .failure = {},
                  .ate_m = kNone,
                  .rte_m = kNone,
                  .correct_rate = kNone,
                  .coverage = kNone,
                  .frame_ms = kNone,
                  .frames = kNone,
                  .tracked = kNone};
  std::error_code error;
  if (!std::filesystem::exists(output / "report.json", error)) {
    outcome.failure = last_line(output / "log.txt");
    return outcome;
  }
  const nlohmann::json report = read_report(output / "report.json");
  outcome.frames = number(report, "/frames"_json_pointer);
  outcome.tracked = number(report, "/tracked"_json_pointer);
  outcome.frame_ms = number(report, "/times_ms/process/mean"_json_pointer);
  const char* const file =
      sequence.frame == ReferenceFrame::kCamera ? "final_camera.txt" : "final_base.txt";
  const auto evaluation = read_trajectory(output / file).and_then([&](const TrajectoryFile& poses) {
    return truth.and_then([&](const TrajectoryFile& reference) {
      return evaluate(poses, during(report, reference), evaluation_options(options));
    });
  });
  if (!evaluation) {
    outcome.failure = evaluation.error().message;
    return outcome;
  }
  outcome.ate_m = evaluation->ate.translation_m.rmse;
  outcome.rte_m = evaluation->stretches.empty() ? kNone : evaluation->rpe.translation_m.rmse;
  outcome.coverage = evaluation->coverage;
  outcome.correct_rate = evaluation->correct_rate.value_or(kNone);
  if (!(outcome.correct_rate >= 0.5)) {
    outcome.failure = fmt::format("within {} m for {:.2f} of the time only",
                                  options.correct_within_m, outcome.correct_rate);
  }
  return outcome;
}

BenchTable sequence_table(Suite suite, const std::vector<Outcome>& outcomes) {
  BenchTable table{.benchmark = "table",
                   .columns = {"sequence", "row", "ate_m", "rte_m", "correct_rate", "coverage",
                               "frame_ms", "frames", "tracked", "paper_ate_m", "failure"},
                   .rows = {}};
  for (const Outcome& outcome : outcomes) {
    const PublishedSequence* published = find_published(to_string(suite), outcome.sequence);
    table.rows.push_back(
        {outcome.sequence, outcome.row, outcome.ate_m, outcome.rte_m, outcome.correct_rate,
         outcome.coverage, outcome.frame_ms, outcome.frames, outcome.tracked,
         published != nullptr ? published->ate_m.value_or(kNone) : kNone, outcome.failure});
  }
  return table;
}

BenchTable summary_table(Suite suite, const std::vector<Outcome>& outcomes) {
  BenchTable table{.benchmark = "summary",
                   .columns = {"set", "row", "sequences", "failures", "ate_m", "rte_m",
                               "correct_rate", "frame_ms", "paper_ate_m", "paper_rte_m"},
                   .rows = {}};
  std::vector<std::string> rows;
  for (const Outcome& outcome : outcomes) {
    if (std::ranges::find(rows, outcome.row) == rows.end()) {
      rows.push_back(outcome.row);
    }
  }
  for (const std::string_view set : {"all", "table III"}) {
    for (const std::string& row : rows) {
      const auto counts = [&](const Outcome& outcome) {
        return outcome.row == row && (set == "all" || in_table_iii(suite, outcome));
      };
      const std::vector<const Outcome*> chosen = those_where(outcomes, counts);
      if (set == "all" || (!chosen.empty() && chosen.size() == table_iii_size(to_string(suite)))) {
        add_means(suite, set, row, chosen, table);
      }
    }
  }
  return table;
}

}  // namespace geoflow::tools
