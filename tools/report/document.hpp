#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "geoflow/tools/plot.hpp"

#include "report/accuracy.hpp"
#include "report/run_directory.hpp"
#include "report/streams.hpp"

/// A run as a page: what it says, in the order in which it says it.
namespace geoflow::tools {

/// All that a report is made from.
struct ReportContent {
  RunDirectory run;
  std::optional<Accuracy> accuracy{};        ///< where there is a truth
  std::optional<RecordingTimes> times{};     ///< where the recording could be read
  std::optional<nlohmann::json> ablation{};  ///< table.json of `geoflow bench table`
  std::vector<std::string> warnings{};       ///< sentences on what is left out, and why
};

/// A figure of the report and the file that has it as a picture.
struct NamedFigure {
  std::string png;
  Figure figure;
};

/// A part of the page under a heading.
struct Section {
  std::string heading;
  std::string text;
  nlohmann::json tables = nlohmann::json::array();  ///< of `columns` and `rows` of texts
  std::optional<NamedFigure> figure{};
};

/// The sections that the content has something for. Pure.
[[nodiscard]] std::vector<Section> report_sections(const ReportContent& content);

/// The page's data (docs/report.md). Pure.
[[nodiscard]] nlohmann::json page_data(const ReportContent& content,
                                       const std::vector<Section>& sections);

}  // namespace geoflow::tools
