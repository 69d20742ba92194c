#include "geoflow/tools/evaluate/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

namespace geoflow::tools {

Statistics statistics(std::vector<double> errors) {
  Statistics result;
  if (errors.empty()) {
    return result;
  }
  std::ranges::sort(errors);
  const auto count = static_cast<double>(errors.size());
  const std::size_t middle = errors.size() / 2;
  result.count = errors.size();
  result.min = errors.front();
  result.max = errors.back();
  result.median =
      errors.size() % 2 == 1 ? errors[middle] : 0.5 * (errors[middle - 1] + errors[middle]);
  result.mean = std::accumulate(errors.begin(), errors.end(), 0.0) / count;
  result.sse = std::inner_product(errors.begin(), errors.end(), errors.begin(), 0.0);
  result.rmse = std::sqrt(result.sse / count);
  double squares = 0;
  for (const double error : errors) {
    squares += (error - result.mean) * (error - result.mean);
  }
  result.std = std::sqrt(squares / count);
  return result;
}

}  // namespace geoflow::tools
