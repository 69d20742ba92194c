#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/bench/table.hpp"

namespace geoflow::tools {

/// What is simulated: walks of a second or more with all knobs at their defaults, but without the
/// time that the robot stands before its first step.
struct SimulateBenchmarkOptions {
  std::vector<std::string> scenes{};  ///< empty: default_benchmark_scenes()
  std::uint64_t seed = 1;
  // NOLINTNEXTLINE(readability-magic-numbers): named by its member
  int frames = 60;  ///< of each scene; at least kFewestBenchmarkFrames
};
inline constexpr int kFewestBenchmarkFrames = 30;

/// The paper's four places, a home, and the cases of structure and texture that have all and
/// nothing.
[[nodiscard]] std::vector<std::string> default_benchmark_scenes();

/// Makes recordings as `geoflow simulate` does, in a temporary folder, and measures how fast. One
/// row for each scene: `start_s` until the first frame can be rendered; `frames_per_s` of wall time
/// and `cpu_ms` a frame (of all threads) with as many threads as `threads` says; then the parts of
/// a frame's CPU time in a run of its own with one thread: `light_ms` to trace and shade what is
/// seen, `sensor_ms` for what the sensors make of it, `writing_ms` to compress and
/// write, with inertial and leg samples. Blocks. `progress` gets scenes done and all; false ends it
/// early, with the rows that are whole. Errors: a scene that cannot be; the disk.
[[nodiscard]] Result<BenchTable> run_simulate_benchmark(
    const SimulateBenchmarkOptions& options,
    const std::function<bool(std::size_t done, std::size_t total)>& progress);

}  // namespace geoflow::tools
