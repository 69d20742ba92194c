#pragma once

#include <span>
#include <string>
#include <vector>

/// The paper's ablation rows (section V-B), made of the estimator's switches.
namespace geoflow::tools {

/// One configuration of the estimator.
struct AblationRow {
  std::string name;                   ///< `r+o`
  std::vector<std::string> settings;  ///< `section.key=value`, for `geoflow replay --set`
};

struct AblationRows {
  std::vector<AblationRow> available;  ///< in the paper's order
  std::vector<std::string> left_out;   ///< sentences: which row, and the key it would need
};

/// The rows that an estimator with these configuration keys can run: r (none of the three), r+o,
/// r+i, r+d and r+o+i+d. o is optical flow, i GICP, d depth to map; each row sets those of the
/// three that there are. Everything else (IMU, legs, …) stays as configured. Pure.
[[nodiscard]] AblationRows ablation_rows(std::span<const std::string> keys);

}  // namespace geoflow::tools
