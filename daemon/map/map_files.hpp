#pragma once

#include <filesystem>
#include <memory>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"

/// The files of the map that the daemon has: its own, and beside it the one before (`.old`). Any
/// thread; one at a time.
namespace geoflow::daemon {

/// Reads a map that this camera made. Errors as of slam::load_map() and, naming the file, of
/// slam::made_with().
[[nodiscard]] Result<std::shared_ptr<const slam::StoredMap>> load_own_map(
    const std::filesystem::path& file, const Calibration& calibration);

/// Renames `file` to `file.old`, in the place of one that was there, and returns that name; empty
/// where there is no file (an empty path, too). kSystem where it cannot be.
[[nodiscard]] Result<std::filesystem::path> move_aside(const std::filesystem::path& file);

/// Has `file` hold `next`, and `file.old`, whose name it returns, what was before: `former` or,
/// where that is null, the file as it is. `next` may have been read from either. Errors as of
/// slam::save_map(), among them that `next` is damaged, and of move_aside(); both files are as they
/// were then.
[[nodiscard]] Result<std::filesystem::path> replace_map(const std::filesystem::path& file,
                                                        const slam::StoredMap& next,
                                                        const slam::StoredMap* former);

}  // namespace geoflow::daemon
