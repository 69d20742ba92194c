#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "geoflow/tools/evaluate/alignment.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"
#include "geoflow/tools/trajectory_file.hpp"

/// Any bytes as a trajectory file in every form, and what was read evaluated against itself and
/// aligned by scale.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace geoflow::tools;
  const void* generic = data;
  const std::string_view text{static_cast<const char*>(generic), size};
  for (const auto format :
       {std::optional<TrajectoryFormat>{}, std::optional{TrajectoryFormat::kTum},
        std::optional{TrajectoryFormat::kKitti}, std::optional{TrajectoryFormat::kEuroc}}) {
    const auto file = parse_trajectory(text, "input", format);
    if (!file) {
      continue;
    }
    for (const Alignment alignment : {Alignment::kOrigin, Alignment::kSim3}) {
      static_cast<void>(evaluate(*file, *file, {.alignment = alignment}));
    }
  }
  return 0;
}
