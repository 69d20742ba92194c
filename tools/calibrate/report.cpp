#include "calibrate/report.hpp"

#include <span>
#include <string>
#include <string_view>

#include <fmt/core.h>

#include "geoflow/calibration/finding.hpp"

#include "calibrate/outcome.hpp"

namespace geoflow::tools {
namespace {

constexpr std::string_view kStyle =
    "body{font:15px/1.4 sans-serif;margin:2em auto;max-width:72em;padding:0 1em}"
    "table{border-collapse:collapse}td,th{padding:.2em .8em;border-bottom:1px solid #ddd;"
    "text-align:left}td.n{text-align:right;font-variant-numeric:tabular-nums}"
    ".PASS{color:#007a50}.WARN{color:#a05a00}.FAIL{color:#b00020}img{max-width:100%}";

std::string escaped(std::string_view text) {
  std::string html;
  for (const char c : text) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

std::string row(const calibration::Finding& finding) {
  const char* verdict = calibration::to_string(finding.verdict);
  return fmt::format(
      "<tr><td>{}</td><td class=\"n\">{}</td><td>{}</td><td class=\"{}\">{}</td><td>{}</td></tr>\n",
      escaped(finding.name), escaped(value_text(finding)), escaped(finding.unit), verdict, verdict,
      escaped(finding.note));
}

}  // namespace

std::string to_html(const Outcome& outcome, const std::string& date,
                    std::span<const std::string> figure_files) {
  const char* verdict = calibration::to_string(calibration::overall(outcome.findings));
  std::string page = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>"
      "<style>{1}</style></head><body>\n<h1>{0}: <span class=\"{2}\">{2}</span></h1>\n<p>{3}, "
      "device {4}, made {5}</p>\n",
      escaped(outcome.title), kStyle, verdict, escaped(outcome.input.recording.string()),
      outcome.input.serial.empty() ? "unknown" : escaped(outcome.input.serial), date);
  for (const std::string& fact : outcome.input.facts) {
    page += fmt::format("<p>{}</p>\n", escaped(fact));
  }
  page += "<table><tr><th></th><th>value</th><th>unit</th><th></th><th></th></tr>\n";
  for (const calibration::Finding& finding : outcome.findings) {
    page += row(finding);
  }
  page += "</table>\n";
  for (const std::string& file : figure_files) {
    page += fmt::format("<p><img src=\"{0}\" alt=\"{0}\"></p>\n", escaped(file));
  }
  return page + "</body></html>\n";
}

}  // namespace geoflow::tools
