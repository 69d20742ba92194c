#include "bench/suite/ablation.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <string_view>

#include <fmt/core.h>

namespace geoflow::tools {
namespace {

struct Switch {
  char letter;
  std::string_view key;
};

constexpr std::array<Switch, 3> kSwitches = {
    {{.letter = 'o', .key = "slam.switches.optical_flow"},
     {.letter = 'i', .key = "slam.switches.gicp"},
     {.letter = 'd', .key = "slam.switches.depth_to_map"}}};
constexpr std::array<std::string_view, 5> kRows = {"r", "r+o", "r+i", "r+d", "r+o+i+d"};

}  // namespace

AblationRows ablation_rows(std::span<const std::string> keys) {
  const auto there = [&](const Switch& one) {
    return std::ranges::find(keys, one.key) != keys.end();
  };
  AblationRows rows;
  for (const std::string_view name : kRows) {
    const auto wanted = [&](const Switch& one) {
      return name.find(one.letter) != std::string_view::npos;
    };
    const auto* const missing = std::ranges::find_if(
        kSwitches, [&](const Switch& one) { return wanted(one) && !there(one); });
    if (missing != kSwitches.end()) {
      rows.left_out.push_back(
          fmt::format("{}: this estimator has no switch {}", name, missing->key));
      continue;
    }
    AblationRow& row =
        rows.available.emplace_back(AblationRow{.name = std::string{name}, .settings = {}});
    for (const Switch& one : kSwitches) {
      if (there(one)) {
        row.settings.push_back(fmt::format("{}={}", one.key, wanted(one)));
      }
    }
  }
  return rows;
}

}  // namespace geoflow::tools
