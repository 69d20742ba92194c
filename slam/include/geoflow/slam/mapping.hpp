#pragma once

#include <memory>

#include "geoflow/slam/stage.hpp"

namespace geoflow::slam {

struct MappingProblem;
struct MappingSolution;

/// A snapshot of the part of the map that one local bundle adjustment works on. It shares nothing
/// that changes with the Core it came from, so it may be solved in any thread. Opaque; copies
/// share.
struct MappingTask {
  std::shared_ptr<const MappingProblem> problem;
};

/// What that adjustment found. Opaque; copies share.
struct MappingResult {
  std::shared_ptr<const MappingSolution> solution;
};

/// Local bundle adjustment (paper IV-C, figure 4). Pure and deterministic; thread-safe. `observer`
/// may be null.
[[nodiscard]] MappingResult optimise(const MappingTask& task, StageObserver* observer = nullptr);

}  // namespace geoflow::slam
