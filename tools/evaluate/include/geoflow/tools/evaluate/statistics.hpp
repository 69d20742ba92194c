#pragma once

#include <cstddef>
#include <vector>

namespace geoflow::tools {

/// Statistics of a set of errors, in the errors' unit (sse: squared). The standard deviation is the
/// population's (divided by the count); the median of an even count is the mean of the middle two.
struct Statistics {
  std::size_t count = 0;
  double rmse = 0;
  double mean = 0;
  double median = 0;
  double std = 0;
  double min = 0;
  double max = 0;
  double sse = 0;
};

/// All zero for no errors. Pure.
[[nodiscard]] Statistics statistics(std::vector<double> errors);

}  // namespace geoflow::tools
