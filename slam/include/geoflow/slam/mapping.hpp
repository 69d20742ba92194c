#pragma once

#include <cstdint>
#include <memory>

#include "geoflow/slam/stage.hpp"

namespace geoflow::slam {

struct LoopProblem;
struct LoopSolution;
struct MappingProblem;
struct MappingSolution;
struct PoseGraphProblem;
struct PoseGraphSolution;

/// A snapshot of the part of the map that some work in the background is about: a new keyframe's
/// local bundle adjustment with the search for loops that it closes, the correction of the whole
/// map for loops that were found, or the adjustment of all of it after that. It shares nothing that
/// changes with the Core it came from, so it may be worked on in any thread. Opaque; copies share.
struct MappingTask {
  std::shared_ptr<const MappingProblem> problem;       ///< null: none to solve
  std::shared_ptr<const LoopProblem> loops = nullptr;  ///< null: nothing looks like the keyframe
  std::shared_ptr<const PoseGraphProblem> graph = nullptr;  ///< null: none to solve
  std::uint32_t revision = 0;  ///< how often the whole map had been moved at the snapshot
};

/// What came out, for each part of the task. Opaque; copies share.
struct MappingResult {
  std::shared_ptr<const MappingSolution> solution;
  std::shared_ptr<const LoopSolution> loops = nullptr;
  std::shared_ptr<const PoseGraphSolution> graph = nullptr;
  std::uint32_t revision = 0;  ///< of the task
};

/// Bundle adjustment, local (paper IV-C, figure 4) or global, comparison of views, pose graph:
/// whatever the task asks for. Pure and deterministic; thread-safe. `observer` may be null.
[[nodiscard]] MappingResult optimise(const MappingTask& task, StageObserver* observer = nullptr);

}  // namespace geoflow::slam
