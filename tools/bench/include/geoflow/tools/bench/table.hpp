#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace geoflow::tools {

/// A name, a count or a measured value (not finite: nothing was measured).
using BenchCell = std::variant<std::string, std::int64_t, double>;

/// A benchmark's result: column names carry the unit as a suffix (`total_ms`) and are the keys of
/// the JSON form.
struct BenchTable {
  std::string benchmark;  ///< "replay", "gicp"
  std::vector<std::string> columns;
  std::vector<std::vector<BenchCell>> rows;  ///< as many cells each as there are columns
};

/// The machine and build a measurement was made on, for people who compare.
struct Machine {
  std::string cpu;  ///< as /proc/cpuinfo names it
  int cores = 0;    ///< that the system schedules on
  std::string kernel;
  std::string compiler;
};

/// This one. Thread-safe.
[[nodiscard]] Machine this_machine();

/// A Markdown table whose columns line up. Pure.
[[nodiscard]] std::string to_markdown(const BenchTable& table);

/// A header line and one line a row; cells with commas or quotes are quoted (RFC 4180). Pure.
[[nodiscard]] std::string to_csv(const BenchTable& table);

/// `{"benchmark":…,"machine":{"cpu","cores","kernel","compiler"},"rows":[{column: value, …}]}`;
/// null where nothing was measured.
[[nodiscard]] nlohmann::json to_json(const BenchTable& table, const Machine& machine);

}  // namespace geoflow::tools
