#pragma once

#include <filesystem>
#include <fstream>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/simulator/simulation.hpp"

namespace geoflow::simulator {

/// Writes what is true beside a simulated recording (docs/simulator.md): groundtruth.txt and
/// groundtruth_base.txt, the poses of the colour camera and of base_link in the world at each
/// colour image, as TUM text; truth.csv, a line for each inertial sample. Thread-bound.
class TruthFiles {
 public:
  /// `directory` exists.
  explicit TruthFiles(std::filesystem::path directory);

  void add(const FrameTruth& frame);
  void add(const TruthSample& sample);

  /// Ends the files. Errors: one cannot be written.
  [[nodiscard]] Result<void> close();

 private:
  std::filesystem::path directory_;
  Trajectory camera_;
  Trajectory base_;
  std::ofstream table_;
};

}  // namespace geoflow::simulator
