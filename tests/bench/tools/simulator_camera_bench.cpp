#include <cstdint>
#include <memory>

#include <benchmark/benchmark.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/mount.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "geoflow/tools/simulator/walk.hpp"
#include "geoflow/tools/simulator/walk_options.hpp"

/// Frames of a walk through each scene at the camera's own size and rate: 640 x 480, 4
/// sub-exposures, 30 frames/s. `Time` is the wall's, `CPU` that of all threads.
namespace geoflow::simulator {
namespace {

void render(benchmark::State& state, const char* name) {
  constexpr double kRate_hz = 30.0;
  keep_freed_memory();
  constexpr std::uint64_t kFirstFrame = 150;  // the robot walks
  const Scene scene = make_scene(name, 1, {}).value();
  const Walk walk = plan_walk(scene.path(), WalkOptions{}).value();
  const auto camera = CameraSimulator::create(scene, {}).value();
  const SE3 T_base_cam = go2_T_base_cam();
  const auto pose = [&](double t_s) { return walk.body().at(t_s).T_world_base * T_base_cam; };
  std::uint64_t frame = kFirstFrame;
  while (state.KeepRunning()) {
    benchmark::DoNotOptimize(camera->render(static_cast<double>(frame) / kRate_hz, frame, pose));
    ++frame;
  }
  state.SetItemsProcessed(state.iterations());
}

constexpr int kFrames = 30;
void sized(benchmark::internal::Benchmark* benchmark) {
  benchmark->Iterations(kFrames)
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime()
      ->MeasureProcessCPUTime();
}
BENCHMARK_CAPTURE(render, office, "office")->Apply(sized);
BENCHMARK_CAPTURE(render, corridor, "corridor")->Apply(sized);
BENCHMARK_CAPTURE(render, parking, "parking")->Apply(sized);
BENCHMARK_CAPTURE(render, plaza, "plaza")->Apply(sized);
BENCHMARK_CAPTURE(render, home, "home")->Apply(sized);

}  // namespace
}  // namespace geoflow::simulator
