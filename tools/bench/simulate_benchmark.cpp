#include "bench/simulate_benchmark.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <tbb/task_arena.h>
#include <tl/expected.hpp>

#include "geoflow/hal/cpu_time.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/bench/scratch_folder.hpp"
#include "geoflow/tools/bench/table.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/simulation.hpp"

#include "simulate/writer.hpp"

namespace geoflow::tools {
namespace {

using simulator::Simulation;
using simulator::SimulationCost;
using simulator::SimulationOptions;

constexpr std::size_t kWarmUp = 5;  // frames before the clock is read
constexpr double kMillisecondsPerSecond = 1e3;

SimulationOptions walk_of(const SimulateBenchmarkOptions& options, const std::string& scene) {
  SimulationOptions walk{.scene = scene, .seed = options.seed};
  walk.walk.stand_s = 0;
  walk.duration_s = (options.frames - 0.5) / walk.recording.frame_rate_hz;
  return walk;
}

/// How long frames took once the first ones were made.
struct Measured {
  double start_s = 0;
  double wall_s = 0;
  double cpu_s = 0;
  std::size_t frames = 0;
  SimulationCost cost;  ///< of all frames
};

Result<Measured> measure(const SimulationOptions& options) {
  const ScratchFolder scratch;
  if (scratch.path().empty()) {
    return fail_errno("a temporary folder for the recording");
  }
  Measured measured;
  const HostTime started = HostClock::now();
  auto simulation = Simulation::create(options);
  if (!simulation) {
    return tl::unexpected{std::move(simulation.error())};
  }
  measured.start_s = to_seconds(HostClock::now() - started);
  HostTime begin;
  double begin_cpu_s = 0;
  const auto written = write_simulation(**simulation, {.directory = scratch.path() / "bag"},
                                        [&](std::size_t done, std::size_t /*total*/) {
                                          if (done == kWarmUp) {
                                            begin = HostClock::now();
                                            begin_cpu_s = process_cpu_s();
                                          } else if (done > kWarmUp) {
                                            measured.frames = done - kWarmUp;
                                            measured.wall_s = to_seconds(HostClock::now() - begin);
                                            measured.cpu_s = process_cpu_s() - begin_cpu_s;
                                          }
                                          return true;
                                        });
  if (!written) {
    return tl::unexpected{written.error()};
  }
  measured.cost = (*simulation)->cost();
  return measured;
}

Result<std::vector<BenchCell>> row_of(const SimulateBenchmarkOptions& options,
                                      const std::string& scene) {
  const SimulationOptions walk = walk_of(options, scene);
  const auto whole = measure(walk);
  if (!whole) {
    return tl::unexpected{whole.error()};
  }
  const auto alone = tbb::task_arena{1}.execute([&] { return measure(walk); });
  if (!alone) {
    return tl::unexpected{alone.error()};
  }
  const double frames = options.frames;
  const auto timed = static_cast<double>(whole->frames);
  const SimulationCost& cost = alone->cost;
  return std::vector<BenchCell>{scene,
                                std::int64_t{options.frames},
                                std::int64_t{tbb::this_task_arena::max_concurrency()},
                                whole->start_s,
                                timed / whole->wall_s,
                                kMillisecondsPerSecond * whole->cpu_s / timed,
                                kMillisecondsPerSecond * cost.render.light_s / frames,
                                kMillisecondsPerSecond * cost.render.sensor_s / frames,
                                kMillisecondsPerSecond * cost.delivery_s / frames};
}

}  // namespace

std::vector<std::string> default_benchmark_scenes() {
  return {"office", "corridor", "parking", "plaza", "home", "str_tex_near", "nostr_notex_far"};
}

Result<BenchTable> run_simulate_benchmark(
    const SimulateBenchmarkOptions& options,
    const std::function<bool(std::size_t done, std::size_t total)>& progress) {
  if (options.frames < kFewestBenchmarkFrames) {
    return fail(ErrorCode::kInvalidArgument, "{} frames: must be at least {}", options.frames,
                kFewestBenchmarkFrames);
  }
  const std::vector<std::string> scenes =
      options.scenes.empty() ? default_benchmark_scenes() : options.scenes;
  simulator::keep_freed_memory();
  BenchTable table{.benchmark = "simulate",
                   .columns = {"scene", "frames", "threads", "start_s", "frames_per_s", "cpu_ms",
                               "light_ms", "sensor_ms", "writing_ms"},
                   .rows = {}};
  for (const std::string& scene : scenes) {
    auto row = row_of(options, scene);
    if (!row) {
      return tl::unexpected{std::move(row.error())};
    }
    table.rows.push_back(*std::move(row));
    if (!progress(table.rows.size(), scenes.size())) {
      break;
    }
  }
  return table;
}

}  // namespace geoflow::tools
