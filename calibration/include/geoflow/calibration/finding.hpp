#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

/// What a calibration says of each of its parameters, and whether that is good enough.
namespace geoflow::calibration {

enum class Verdict : std::uint8_t {
  kPass,  ///< determined, and as good as the use of it asks
  kWarn,  ///< usable with care: not determined well, or unusual; the note says why
  kFail,  ///< must not be used; the note says why
};

/// "PASS", "WARN" or "FAIL".
[[nodiscard]] const char* to_string(Verdict verdict) noexcept;

/// One parameter as it was found.
struct Finding {
  std::string name;  ///< as in the result file, "accel_x.white_noise"
  double value = 0;
  /// One standard deviation; none where the recording bounds the parameter from above only, and
  /// `value` is that bound (two standard deviations above what was found).
  std::optional<double> sigma{};
  std::string unit;
  Verdict verdict = Verdict::kPass;
  std::string note{};  ///< a sentence where the verdict is not PASS; may be empty otherwise
};

/// The worst verdict of all; kPass of none.
[[nodiscard]] Verdict overall(std::span<const Finding> findings) noexcept;

}  // namespace geoflow::calibration
