#pragma once

#include <cstdint>
#include <optional>

#include "geoflow/hal/time.hpp"

namespace geoflow::timesync {

/// Stamps [ns] outside this range (years 1897 to 2116 from a 1970 epoch) are taken for garbage, so
/// that no difference of two accepted stamps can overflow.
inline constexpr std::int64_t kMinStampNs = -(std::int64_t{1} << 61);
inline constexpr std::int64_t kMaxStampNs = std::int64_t{1} << 62;

[[nodiscard]] constexpr bool is_plausible_stamp_ns(std::int64_t stamp_ns) noexcept {
  return stamp_ns >= kMinStampNs && stamp_ns <= kMaxStampNs;
}

/// The value congruent to `raw_ns` modulo `period_ns` (> 0) that is nearest to `expected_ns`: the
/// count of a wrapping counter. Right while the expectation is within half a period. All values
/// plausible stamps.
[[nodiscard]] std::int64_t unwrap_ns(std::int64_t raw_ns, std::int64_t period_ns,
                                     std::int64_t expected_ns) noexcept;

}  // namespace geoflow::timesync
