#include "geoflow/calibration/finding.hpp"

#include <algorithm>
#include <span>

namespace geoflow::calibration {

const char* to_string(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::kPass:
      return "PASS";
    case Verdict::kWarn:
      return "WARN";
    case Verdict::kFail:
      break;
  }
  return "FAIL";
}

Verdict overall(std::span<const Finding> findings) noexcept {
  Verdict worst = Verdict::kPass;
  for (const Finding& finding : findings) {
    worst = std::max(worst, finding.verdict);
  }
  return worst;
}

}  // namespace geoflow::calibration
