#include "report/tables.hpp"

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/tools/evaluate/consistency.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"

#include "report/accuracy.hpp"
#include "report/streams.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

constexpr double kPercent = 100;

json table_of(json columns) {
  return {{"columns", std::move(columns)}, {"rows", json::array()}};
}

/// A value as a person reads it.
std::string cell(const json& value) {
  if (value.is_string()) {
    return value.get<std::string>();
  }
  if (value.is_number_float()) {
    return fmt::format("{:.4g}", value.get<double>());
  }
  return value.is_null() ? "" : value.dump(-1, ' ', false, json::error_handler_t::replace);
}

/// The object at a key; an empty one where there is none.
json object_of(const json& object, std::string_view key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_object() ? *found : json::object();
}

json statistics_row(const std::string& name, const Statistics& s) {
  json row{name};
  for (const double value : {s.rmse, s.mean, s.median, s.std, s.min, s.max}) {
    row.push_back(fmt::format("{:.6f}", value));
  }
  return row;
}

void add_evaluation(json& rows, const std::string& which, const Evaluation& evaluation) {
  rows.push_back(statistics_row("ATE [m], " + which, evaluation.ate.translation_m));
  rows.push_back(statistics_row("ATE [deg], " + which, evaluation.ate.rotation_deg));
  if (!evaluation.stretches.empty()) {
    rows.push_back(statistics_row("RPE [m], " + which, evaluation.rpe.translation_m));
    rows.push_back(statistics_row("RPE [deg], " + which, evaluation.rpe.rotation_deg));
  }
}

/// A row for each count that is not zero, below a name that ends in the count's key.
void add_counts(json& rows, const std::string& name, const json& counts) {
  for (const auto& [key, count] : counts.items()) {
    if (count.is_number() && count != 0) {
      rows.push_back({name + key, cell(count)});
    }
  }
}

/// What befell samples of a stream in the synchroniser, but for their ordinary use.
void add_fates(json& rows, const std::string& stream, const json& fates) {
  for (const std::string_view fate :
       {"late", "duplicate", "invalid", "outlier", "overflow", "reordered", "silences", "jumps"}) {
    const auto count = fates.find(fate);
    if (count != fates.end() && count->is_number() && *count != 0) {
      rows.push_back({fmt::format("synchroniser: {}, {}", stream, fate), cell(*count)});
    }
  }
}

}  // namespace

json error_table(const Accuracy& accuracy) {
  json table = table_of({"error", "RMSE", "mean", "median", "std", "min", "max"});
  add_evaluation(table["rows"], "final", accuracy.last);
  add_evaluation(table["rows"], "live", accuracy.live);
  return table;
}

json consistency_table(const Consistency& consistency) {
  json table =
      table_of({"NEES by status", "estimates", "position", "orientation", "pose", "within 95 %"});
  for (std::size_t i = 0; i < consistency.by_status.size(); ++i) {
    const Nees& nees = consistency.by_status.at(i);
    if (nees.estimates > 0) {
      table["rows"].push_back(
          {to_string(static_cast<TrackingStatus>(i)), fmt::format("{}", nees.estimates),
           fmt::format("{:.3f}", nees.position), fmt::format("{:.3f}", nees.orientation),
           fmt::format("{:.3f}", nees.pose), fmt::format("{:.1f} %", kPercent * nees.within_95)});
    }
  }
  return table;
}

json status_table(const json& report) {
  json table = table_of({"status", "frames"});
  add_counts(table["rows"], "", object_of(report, "by_status"));
  return table;
}

json loss_table(const json& report) {
  json table = table_of({"lost or put right on the way", "samples"});
  json& rows = table["rows"];
  add_counts(rows, "dropped for want of room: ", object_of(report, "drops"));
  const json faults = object_of(report, "faults");
  for (const auto& [kind, streams] : faults.items()) {
    add_counts(rows, "fault script: " + kind + ", ", streams);
  }
  const json streams = object_of(report, "synchroniser");
  for (const auto& [stream, fates] : streams.items()) {
    if (fates.is_object()) {
      add_fates(rows, stream, fates);
    }
  }
  add_counts(rows, "could not be read: ", object_of(report, "rejected"));
  if (rows.empty()) {
    rows.push_back({"nothing", "0"});
  }
  return table;
}

json time_table(const json& report) {
  json table = table_of({"stage", "count", "mean [ms]", "p50 [ms]", "p99 [ms]", "max [ms]"});
  for (const auto& [stage, times] : report.at("times_ms").items()) {
    if (times.at("count") == 0) {
      continue;
    }
    json row{stage, cell(times.at("count"))};
    for (const char* key : {"mean", "p50", "p99", "max"}) {
      row.push_back(fmt::format("{:.2f}", times.at(key).get<double>()));
    }
    table["rows"].push_back(std::move(row));
  }
  return table;
}

json stream_table(const RecordingTimes& times) {
  json table = table_of(
      {"stream", "samples", "median interval [ms]", "longest [ms]", "gaps", "samples missing"});
  for (const StreamTimes& stream : times.streams) {
    const StreamGaps gaps = find_gaps(stream);
    table["rows"].push_back({stream.name, fmt::format("{}", stream.t_s.size()),
                             fmt::format("{:.3f}", gaps.median_ms),
                             fmt::format("{:.3f}", gaps.longest_ms), fmt::format("{}", gaps.gaps),
                             fmt::format("{}", gaps.missing)});
  }
  if (times.rejected > 0) {
    table["rows"].push_back(
        {"could not be read", fmt::format("{}", times.rejected), "", "", "", ""});
  }
  return table;
}

json ablation_table(const json& given) {
  constexpr std::array kColumns{"set",   "row",          "sequences", "failures",    "ate_m",
                                "rte_m", "correct_rate", "frame_ms",  "paper_ate_m", "paper_rte_m"};
  json table = table_of(kColumns);
  for (const json& summary : given.at("summary")) {
    json row = json::array();
    for (const char* column : kColumns) {
      row.push_back(summary.is_object() ? cell(summary.value(column, json{})) : "");
    }
    table["rows"].push_back(std::move(row));
  }
  return table;
}

json configuration_table(const json& report) {
  json table = table_of({"key", "value"});
  for (const auto& [key, value] : report.at("configuration").items()) {
    table["rows"].push_back({key, cell(value)});
  }
  return table;
}

std::string text_of(const json& object, std::string_view key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string{};
}

}  // namespace geoflow::tools
