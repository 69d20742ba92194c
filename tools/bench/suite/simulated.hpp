#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "bench/suite/sequences.hpp"

/// The sequences of the suite `sim`, which are made where they are missing.
namespace geoflow::tools {

struct SimulatedOptions {
  std::filesystem::path program;  ///< the `geoflow` command
  std::filesystem::path data;     ///< each recording is SCENE-SEED in it
  std::vector<std::string> scenes;
  std::vector<std::uint64_t> seeds;
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  double duration_s = 60;
};

/// A sequence and the command that makes it.
struct SimulatedSequence {
  Sequence sequence;
  std::vector<std::string> make;
};

/// Every scene with every seed. Pure.
[[nodiscard]] std::vector<SimulatedSequence> plan_recordings(const SimulatedOptions& options);

/// Seeds such as `1-5,8`: numbers and ranges by commas, at most 10000 in all. Errors name the part
/// that is none.
[[nodiscard]] Result<std::vector<std::uint64_t>> parse_seeds(std::string_view text);

}  // namespace geoflow::tools
