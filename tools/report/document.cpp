#include "report/document.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/tools/evaluate/consistency.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/evaluate/statistics.hpp"
#include "geoflow/tools/plot.hpp"

#include "evaluate/figure.hpp"
#include "report/accuracy.hpp"
#include "report/course.hpp"
#include "report/streams.hpp"
#include "report/tables.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

constexpr double kPercent = 100;

json tile(std::string_view label, const std::string& value, const std::string& note) {
  return {{"label", label}, {"value", value}, {"note", note}};
}

void add_accuracy_tiles(json& tiles, const Accuracy& accuracy) {
  const Evaluation& last = accuracy.last;
  const double path_m = last.path.reference_m;
  tiles.push_back(tile("ATE, final", fmt::format("{:.4f} m", last.ate.translation_m.rmse),
                       path_m > 0
                           ? fmt::format("RMSE, {:.2f} % of {:.1f} m",
                                         kPercent * last.ate.translation_m.rmse / path_m, path_m)
                           : "RMSE"));
  tiles.push_back(
      tile("ATE, live", fmt::format("{:.4f} m", accuracy.live.ate.translation_m.rmse), "RMSE"));
  if (!accuracy.live.stretches.empty()) {
    tiles.push_back(tile("RPE, live", fmt::format("{:.4f} m", accuracy.live.rpe.translation_m.rmse),
                         fmt::format("RMSE over {:g} s", accuracy.options.relative.delta)));
  }
  tiles.push_back(tile("Coverage", fmt::format("{:.1f} %", kPercent * accuracy.live.coverage),
                       "of the reference's time"));
  if (accuracy.normalised) {
    const Nees tracking = consistency(*accuracy.normalised).of(TrackingStatus::kTracking);
    tiles.push_back(
        tile("NEES, TRACKING", fmt::format("{:.2f}", tracking.pose), "1: covariances are true"));
  }
}

json make_tiles(const ReportContent& content) {
  json tiles = json::array();
  if (content.accuracy) {
    add_accuracy_tiles(tiles, *content.accuracy);
  }
  const json& report = content.run.report;
  tiles.push_back(tile("Frames with a pose",
                       fmt::format("{} of {}", report.at("tracked").get<std::uint64_t>(),
                                   report.at("frames").get<std::uint64_t>()),
                       ""));
  if (const auto process = report.at("times_ms").find("process");
      process != report.at("times_ms").end()) {
    tiles.push_back(tile("Time of a frame",
                         fmt::format("{:.1f} ms", process->at("p50").get<double>()),
                         fmt::format("99 % below {:.1f} ms", process->at("p99").get<double>())));
  }
  return tiles;
}

void add_accuracy_sections(std::vector<Section>& sections, const Accuracy& accuracy) {
  sections.push_back(
      {.heading = "Final trajectory against the reference",
       .text = "After all optimisation, laid over the reference by the alignment "
               "that geoflow evaluate uses.",
       .tables = json::array({error_table(accuracy)}),
       .figure = NamedFigure{
           .png = "final.png",
           .figure = evaluation_figure(accuracy.last, accuracy.options, "Final trajectory")}});
  sections.push_back(
      {.heading = "Live trajectory against the reference",
       .text = "Each pose as it was said at its time; loops correct only what comes "
               "after them.",
       .figure = NamedFigure{
           .png = "live.png",
           .figure = evaluation_figure(accuracy.live, accuracy.options, "Live trajectory")}});
  if (!accuracy.live.stretches.empty()) {
    sections.push_back(
        {.heading = "Relative error over time",
         .text = "",
         .figure = NamedFigure{.png = "relative.png", .figure = relative_error_figure(accuracy)}});
  }
  if (accuracy.normalised && !accuracy.normalised->empty()) {
    sections.push_back(
        {.heading = "Error beside the claimed covariance",
         .text = "Of T_odom_base since the first pair. Where a covariance is true, 99.7 % of an "
                 "error's values lie within three standard deviations, and the NEES for each "
                 "degree of freedom is 1 on average.",
         .tables = json::array({consistency_table(consistency(*accuracy.normalised))}),
         .figure = NamedFigure{.png = "covariance.png",
                               .figure = consistency_figure(*accuracy.normalised)}});
  }
}

void add_course_sections(std::vector<Section>& sections, const ReportContent& content) {
  const json& report = content.run.report;
  sections.push_back(
      {.heading = "Status and health",
       .text = "Frames without a pose are gaps.",
       .tables = json::array({status_table(report), loss_table(report)}),
       .figure = NamedFigure{.png = "status.png", .figure = course_figure(content.run)}});
  Section times{.heading = "Times of the stages", .text = ""};
  times.tables.push_back(time_table(report));
  if (Figure figure = time_figure(report); !figure.axes.empty()) {
    times.figure = NamedFigure{.png = "times.png", .figure = std::move(figure)};
  }
  sections.push_back(std::move(times));
}

}  // namespace

std::vector<Section> report_sections(const ReportContent& content) {
  std::vector<Section> sections;
  if (content.accuracy) {
    add_accuracy_sections(sections, *content.accuracy);
  }
  add_course_sections(sections, content);
  if (content.times) {
    sections.push_back(
        {.heading = "Sensor gaps of the recording",
         .text = "The time from each sample to the next, as the devices stamped them.",
         .tables = json::array({stream_table(*content.times)}),
         .figure = NamedFigure{.png = "sensors.png", .figure = interval_figure(*content.times)}});
  }
  if (content.ablation) {
    sections.push_back({.heading = "Component ablation",
                        .text = "Means over the sequences that succeeded, as geoflow bench table "
                                "measured them.",
                        .tables = json::array({ablation_table(*content.ablation)})});
  }
  sections.push_back({.heading = "Configuration",
                      .text = "",
                      .tables = json::array({configuration_table(content.run.report)})});
  return sections;
}

json page_data(const ReportContent& content, const std::vector<Section>& sections) {
  const json& report = content.run.report;
  json data{
      {"title", content.run.recording().filename().string()},
      {"subtitle", fmt::format("Run {} of the recording {}, geoflow {}", content.run.path.string(),
                               content.run.recording().string(), text_of(report, "version"))},
      {"tiles", make_tiles(content)},
      {"warnings", content.warnings},
      {"colors", color_map_json()},
      {"sections", json::array()}};
  for (const Section& section : sections) {
    json one{{"heading", section.heading}, {"text", section.text}, {"tables", section.tables}};
    if (section.figure) {
      one["figure"] = to_json(section.figure->figure);
      one["png"] = section.figure->png;
    }
    data["sections"].push_back(std::move(one));
  }
  return data;
}

}  // namespace geoflow::tools
