#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>

#include "geoflow/hal/result.hpp"

#include "map/map_cloud.hpp"

namespace geoflow::daemon {

/// Work on the map that the estimator must not wait for.
enum class MapJob : std::uint8_t {
  kSave,     ///< write it to its file
  kRestart,  ///< the estimator begins anew and looks for its place in the map as it is
  kForget,   ///< the file is moved aside, and the estimator begins with an empty map
  kLoad,     ///< another file's map takes the place of this one, which is kept aside
  kShow,     ///< its surfaces, for clients
};

/// A job to be done.
struct MapOrder {
  MapJob job = MapJob::kSave;
  std::filesystem::path file{};  ///< of kLoad

  bool operator==(const MapOrder&) const = default;
};

/// How far the estimator was at one time; where it has stayed, there is nothing new to save.
struct MapMark {
  std::uint64_t frames = 0;        ///< estimates
  std::uint64_t mapping_runs = 0;  ///< local bundle adjustments applied

  bool operator==(const MapMark&) const = default;
};

/// What a job has done.
struct MapReport {
  MapJob job = MapJob::kSave;
  std::filesystem::path file{};   ///< that was written or loaded; empty: none
  std::filesystem::path moved{};  ///< where the map of before is kept; empty: there was none
  std::size_t keyframes = 0;      ///< in the map
  std::uintmax_t bytes = 0;       ///< of the written file
  MapMark mark{};                 ///< of what was saved or shown
  std::shared_ptr<const MapCloud> cloud{};  ///< of kShow
};

/// The report, or why not.
struct MapOutcome {
  MapJob job = MapJob::kSave;
  Result<MapReport> report;
};

}  // namespace geoflow::daemon
