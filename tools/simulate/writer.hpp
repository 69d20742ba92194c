#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>

#include <nlohmann/json.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/simulation.hpp"

/// A simulation as files.
namespace geoflow::tools {

struct WriteOptions {
  std::filesystem::path directory;
  bool compress = true;  ///< messages of the bag as Zstandard frames; images stay as they are
  bool tum = false;      ///< also as a TUM RGB-D folder, in `tum`
  nlohmann::json parameters{};  ///< kept as simulation.json
};

/// Writes a whole recording: a rosbag2 with groundtruth.txt, groundtruth_base.txt, truth.csv and
/// simulation.json. It is made beside its place and moved there once it is whole; an interrupted
/// one leaves nothing. `progress` gets frames done and all, and says whether to go on; false: it
/// was interrupted. Errors: `directory` exists; the disk.
[[nodiscard]] Result<bool> write_simulation(
    simulator::Simulation& simulation, const WriteOptions& options,
    const std::function<bool(std::size_t done, std::size_t total)>& progress);

/// Whether `directory` holds a whole simulation with these parameters.
[[nodiscard]] bool is_same_simulation(const std::filesystem::path& directory,
                                      const nlohmann::json& parameters);

/// Removes a simulation. An error if the folder is not one, so that nothing else is lost.
[[nodiscard]] Result<void> remove_simulation(const std::filesystem::path& directory);

}  // namespace geoflow::tools
