#include "bench/suite/simulated.hpp"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fmt/core.h>

#include "geoflow/hal/result.hpp"

namespace geoflow::tools {
namespace {

constexpr std::size_t kMostSeeds = 10'000;

std::optional<std::uint64_t> whole_number(std::string_view text) {
  std::uint64_t value = 0;
  const char* const begin = text.data();
  const char* const end = begin + text.size();
  const auto [stopped, error] = std::from_chars(begin, end, value);
  return error == std::errc{} && stopped == end ? std::optional{value} : std::nullopt;
}

}  // namespace

std::vector<SimulatedSequence> plan_recordings(const SimulatedOptions& options) {
  std::vector<SimulatedSequence> planned;
  for (const std::string& scene : options.scenes) {
    for (const std::uint64_t seed : options.seeds) {
      SimulatedSequence& one = planned.emplace_back();
      one.sequence.name = fmt::format("{}-{}", scene, seed);
      one.sequence.recording = options.data / one.sequence.name;
      one.sequence.reference = one.sequence.recording / "groundtruth.txt";
      one.make = {options.program.string(),
                  "simulate",
                  scene,
                  "-o",
                  one.sequence.recording.string(),
                  "--seed",
                  fmt::format("{}", seed),
                  "--duration",
                  fmt::format("{}", options.duration_s),
                  "--gray",
                  "--reuse"};
    }
  }
  return planned;
}

Result<std::vector<std::uint64_t>> parse_seeds(std::string_view text) {
  std::vector<std::uint64_t> seeds;
  while (!text.empty()) {
    const std::string_view part = text.substr(0, text.find(','));
    text.remove_prefix(std::min(part.size() + 1, text.size()));
    const std::size_t dash = part.find('-');
    const auto first = whole_number(part.substr(0, dash));
    const auto last = dash == std::string_view::npos ? first : whole_number(part.substr(dash + 1));
    if (!first || !last || *last < *first || *last - *first >= kMostSeeds - seeds.size()) {
      return fail(ErrorCode::kInvalidArgument,
                  "--seeds: '{}' is not a number or a range such as 1-5, or too long", part);
    }
    for (std::uint64_t seed = *first; seed <= *last; ++seed) {
      seeds.push_back(seed);
    }
  }
  return seeds;
}

}  // namespace geoflow::tools
