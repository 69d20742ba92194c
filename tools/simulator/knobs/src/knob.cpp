#include "geoflow/tools/simulator/knob.hpp"

#include <charconv>
#include <cmath>
#include <string_view>
#include <system_error>

#include "geoflow/hal/result.hpp"

namespace geoflow::simulator {

Result<double> parse_knob_value(const KnobInfo& knob, std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.begin(), text.end(), value);
  if (error != std::errc{} || end != text.end() || !std::isfinite(value)) {
    return fail(ErrorCode::kInvalidArgument, "{}: \"{}\" is no number", knob.name, text);
  }
  if (value < knob.minimum || value > knob.maximum) {
    return fail(ErrorCode::kInvalidArgument, "{}: {} is outside {} to {} {}", knob.name, text,
                knob.minimum, knob.maximum, knob.unit);
  }
  if (knob.whole && value != std::floor(value)) {
    return fail(ErrorCode::kInvalidArgument, "{}: {} is no whole number", knob.name, text);
  }
  return value;
}

}  // namespace geoflow::simulator
