#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/calibration/finding.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/console.hpp"
#include "geoflow/tools/plot.hpp"

namespace geoflow::tools {

/// What a calibration was made from.
struct CalibrationInput {
  std::filesystem::path recording;
  std::string serial;                ///< of the device; empty where the recording does not say
  std::uint64_t hash = 0;            ///< of the samples that were used
  std::vector<std::string> facts{};  ///< what of it was used, a sentence each
};

/// One calibration as all of them are shown and written.
struct Outcome {
  std::string what;  ///< "imu-noise": the files' name and the verb's argument
  std::string title;
  CalibrationInput input;
  std::vector<calibration::Finding> findings;
  /// What the daemon is to read: name and value, in the table that `what` names.
  std::vector<std::pair<std::string, double>> results{};
  std::vector<Figure> figures{};
};

/// The table for people, or the object for programs (docs/cli.md).
void print(Console& console, const Outcome& outcome);

/// The result as TOML (docs/calibration.md), `date` as in RFC 3339.
[[nodiscard]] std::string to_toml(const Outcome& outcome, const std::string& date);

/// Writes WHAT.toml (unless the verdict is FAIL), WHAT.html and its figures as WHAT-N.png to the
/// folder, which is made where it is not there. Each is replaced as a whole or not at all; a result
/// of before is removed when there is no new one. Errors: kSystem.
[[nodiscard]] Result<void> write(const Outcome& outcome, const std::filesystem::path& folder);

/// `value +- sigma`, or `< value` of a bound.
[[nodiscard]] std::string value_text(const calibration::Finding& finding);

}  // namespace geoflow::tools
