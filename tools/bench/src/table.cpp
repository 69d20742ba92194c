#include "geoflow/tools/bench/table.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

namespace geoflow::tools {
namespace {

/// A cell as people read it: four significant digits.
struct Text {
  std::string operator()(const std::string& value) const { return value; }
  std::string operator()(std::int64_t value) const { return fmt::format("{}", value); }
  std::string operator()(double value) const {
    return std::isfinite(value) ? fmt::format("{:.4g}", value) : "-";
  }
};

struct Json {
  nlohmann::json operator()(const std::string& value) const { return value; }
  nlohmann::json operator()(std::int64_t value) const { return value; }
  nlohmann::json operator()(double value) const {
    return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
  }
};

std::string csv_cell(const BenchCell& cell) {
  if (const auto* number = std::get_if<double>(&cell)) {
    return std::isfinite(*number) ? fmt::format("{}", *number) : "";
  }
  std::string text = std::visit(Text{}, cell);
  if (text.find_first_of(",\"\n") == std::string::npos) {
    return text;
  }
  std::string quoted;
  for (const char c : text) {
    quoted.append(c == '"' ? 2 : 1, c);
  }
  return fmt::format("\"{}\"", quoted);
}

/// The header and all rows as text.
std::vector<std::vector<std::string>> lines_of(const BenchTable& table) {
  std::vector<std::vector<std::string>> lines{table.columns};
  for (const auto& row : table.rows) {
    std::vector<std::string>& line = lines.emplace_back();
    std::ranges::transform(row, std::back_inserter(line),
                           [](const BenchCell& cell) { return std::visit(Text{}, cell); });
  }
  return lines;
}

}  // namespace

std::string to_markdown(const BenchTable& table) {
  const auto lines = lines_of(table);
  std::vector<std::size_t> widths(table.columns.size(), 3);
  for (const auto& line : lines) {
    for (std::size_t i = 0; i < std::min(line.size(), widths.size()); ++i) {
      widths[i] = std::max(widths[i], line[i].size());
    }
  }
  std::string text;
  for (std::size_t n = 0; n < lines.size(); ++n) {
    for (std::size_t i = 0; i < std::min(lines[n].size(), widths.size()); ++i) {
      text += fmt::format("| {:>{}} ", lines[n][i], widths[i]);
    }
    text += "|\n";
    if (n == 0) {
      for (const std::size_t width : widths) {
        text += fmt::format("|{:->{}}:", "", width + 1);
      }
      text += "|\n";
    }
  }
  return text;
}

std::string to_csv(const BenchTable& table) {
  std::string text;
  const auto append = [&text](const auto& cells, const auto& cell_text) {
    for (std::size_t i = 0; i < cells.size(); ++i) {
      text += fmt::format("{}{}", i == 0 ? "" : ",", cell_text(cells[i]));
    }
    text += '\n';
  };
  append(table.columns, [](const std::string& name) { return csv_cell(name); });
  for (const auto& row : table.rows) {
    append(row, csv_cell);
  }
  return text;
}

nlohmann::json to_json(const BenchTable& table, const Machine& machine) {
  nlohmann::json rows = nlohmann::json::array();
  for (const auto& row : table.rows) {
    nlohmann::json object = nlohmann::json::object();
    for (std::size_t i = 0; i < std::min(row.size(), table.columns.size()); ++i) {
      object[table.columns[i]] = std::visit(Json{}, row[i]);
    }
    rows.push_back(std::move(object));
  }
  return {{"benchmark", table.benchmark},
          {"machine",
           {{"cpu", machine.cpu},
            {"cores", machine.cores},
            {"kernel", machine.kernel},
            {"compiler", machine.compiler}}},
          {"rows", std::move(rows)}};
}

}  // namespace geoflow::tools
