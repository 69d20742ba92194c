#include "calibrate/outcome.hpp"

#include <cstddef>
#include <ctime>
#include <filesystem>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/chrono.h>
#include <fmt/core.h>
#include <nlohmann/json.hpp>
#include <toml++/toml.h>

#include "geoflow/calibration/finding.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/output_files.hpp"
#include "geoflow/tools/plot.hpp"

#include "calibrate/report.hpp"

namespace geoflow::tools {
namespace {

namespace fs = std::filesystem;
using calibration::Finding;
using calibration::Verdict;

nlohmann::json to_json(const Finding& finding) {
  nlohmann::json object{{"name", finding.name},
                        {"value", finding.value},
                        {"unit", finding.unit},
                        {"verdict", calibration::to_string(finding.verdict)},
                        {"note", finding.note}};
  object["sigma"] = finding.sigma ? nlohmann::json(*finding.sigma) : nlohmann::json{};
  return object;
}

nlohmann::json to_json(const Outcome& outcome) {
  nlohmann::json findings = nlohmann::json::array();
  for (const Finding& finding : outcome.findings) {
    findings.push_back(to_json(finding));
  }
  return {{"what", outcome.what},
          {"verdict", calibration::to_string(calibration::overall(outcome.findings))},
          {"recording", outcome.input.recording.string()},
          {"serial", outcome.input.serial},
          {"findings", std::move(findings)}};
}

toml::table to_table(const Finding& finding) {
  toml::table table{{"value", finding.value},
                    {"unit", finding.unit},
                    {"verdict", calibration::to_string(finding.verdict)}};
  if (finding.sigma) {
    table.insert("sigma", *finding.sigma);
  }
  if (!finding.note.empty()) {
    table.insert("note", finding.note);
  }
  return table;
}

/// A key of a table may not have the hyphen of a verb's word.
std::string table_name(std::string what) {
  for (char& c : what) {
    c = c == '-' ? '_' : c;
  }
  return what;
}

std::string utc_now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

}  // namespace

std::string value_text(const Finding& finding) {
  return finding.sigma ? fmt::format("{:.4g} +- {:.2g}", finding.value, *finding.sigma)
                       : fmt::format("< {:.2g}", finding.value);
}

void print(Console& console, const Outcome& outcome) {
  console.object(to_json(outcome));
  for (const std::string& fact : outcome.input.facts) {
    console.line("{}", fact);
  }
  for (const Finding& finding : outcome.findings) {
    console.line("{}  {:26} {:>24} {:18}{}{}", calibration::to_string(finding.verdict),
                 finding.name, value_text(finding), finding.unit, finding.note.empty() ? "" : "  ",
                 finding.note);
  }
  console.line("{}: {}", outcome.title,
               calibration::to_string(calibration::overall(outcome.findings)));
}

std::string to_toml(const Outcome& outcome, const std::string& date) {
  toml::table results;
  for (const auto& [name, value] : outcome.results) {
    results.insert(name, value);
  }
  toml::table findings;
  for (const Finding& finding : outcome.findings) {
    findings.insert(finding.name, to_table(finding));
  }
  const toml::table header{
      {"what", outcome.what},
      {"verdict", calibration::to_string(calibration::overall(outcome.findings))},
      {"serial", outcome.input.serial},
      {"date", date},
      {"tool_version", GEOFLOW_VERSION},
      {"recording", outcome.input.recording.string()},
      {"recording_hash", fmt::format("{:016x}", outcome.input.hash)}};
  toml::table document{{"calibration", header}, {"finding", findings}};
  document.insert(table_name(outcome.what), results);
  std::ostringstream text;
  text << "# Made by geoflow calibrate; docs/calibration.md says what it means.\n"
       << document << "\n";
  return text.str();
}

Result<void> write(const Outcome& outcome, const fs::path& folder) {
  if (auto prepared = prepare_output(folder); !prepared) {
    return prepared;
  }
  const std::string date = utc_now();
  std::vector<std::string> figure_files;
  for (std::size_t i = 0; i < outcome.figures.size(); ++i) {
    figure_files.push_back(fmt::format("{}-{}.png", outcome.what, i + 1));
    auto drawn = replace_file(folder / figure_files.back(), [&](const fs::path& path) {
      return save_figure(outcome.figures[i], path);
    });
    if (!drawn) {
      return drawn;
    }
  }
  auto page = replace_file(folder / (outcome.what + ".html"), to_html(outcome, date, figure_files));
  if (!page) {
    return page;
  }
  const fs::path result = folder / (outcome.what + ".toml");
  if (calibration::overall(outcome.findings) != Verdict::kFail) {
    return replace_file(result, to_toml(outcome, date));
  }
  std::error_code code;
  fs::remove(result, code);
  return code ? fail(ErrorCode::kSystem, "{}: {}", result.string(), code.message())
              : Result<void>{};
}

}  // namespace geoflow::tools
