#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

/// Trajectories as text files. Times are read and written as integer nanoseconds, never through a
/// floating-point number. All functions are pure apart from the file they name, and thread-safe.
namespace geoflow::tools {

enum class TrajectoryFormat : std::uint8_t {
  kTum,    ///< `timestamp[s] tx ty tz[m] qx qy qz qw`, `#` comments: the TUM RGB-D benchmark's
  kKitti,  ///< the 12 numbers of the upper 3 x 4 of T, row by row; no times, so line n (from 0)
           ///< gets the time n s
  kEuroc,  ///< EuRoC MAV ground truth: `timestamp[ns],px,py,pz,qw,qx,qy,qz`; further columns are
           ///< ignored
};

/// "tum", "kitti" or "euroc".
[[nodiscard]] const char* to_string(TrajectoryFormat format) noexcept;

/// What was read from one file.
struct TrajectoryFile {
  Trajectory poses;  ///< in strictly ascending order of time
  TrajectoryFormat format = TrajectoryFormat::kTum;
  /// KITTI only, one for each pose: the 3 x 3 rotations as written, orthonormal up to the file's
  /// rounding.
  std::vector<Matrix3d> matrices{};
  /// Sentences on what was put right: lines that were out of order (sorted) and times that occur
  /// twice (the first one counts).
  std::vector<std::string> warnings;
};

/// Times further from zero than this (142 years) are refused, so that differences of times cannot
/// overflow.
inline constexpr Duration kMaxTrajectoryTime{4'500'000'000'000'000'000};

/// Files larger than this are refused before they are read into memory.
inline constexpr std::size_t kMaxTrajectoryFileBytes = std::size_t{1} << 29U;

/// Reads a trajectory; without `format` the first line of data decides (commas: EuRoC; 12 numbers:
/// KITTI; 8: TUM). Errors name file and line: a missing or unreadable file, no pose at all, a wrong
/// number of columns, text that is not a finite number, a quaternion whose norm is more than 1 %
/// away from 1 (closer ones are normalised), a matrix that is no rotation by as much.
[[nodiscard]] Result<TrajectoryFile> read_trajectory(
    const std::filesystem::path& path, std::optional<TrajectoryFormat> format = std::nullopt);

/// The same from memory; `name` stands for the file in messages.
[[nodiscard]] Result<TrajectoryFile> parse_trajectory(
    std::string_view text, std::string_view name,
    std::optional<TrajectoryFormat> format = std::nullopt);

/// One pose as a TUM line without its line end: seconds with 9 decimals (exact), metres and
/// quaternion with 9 decimals, the quaternion with qw >= 0.
[[nodiscard]] std::string format_tum_line(const StampedPose& stamped);

/// Writes a TUM file: a comment that names the columns, then one line a pose. Replaces an existing
/// file.
[[nodiscard]] Result<void> write_tum(const std::filesystem::path& path, const Trajectory& poses);

/// Parses decimal seconds such as "1305031102.160407" or "1.305031102160407e+09" to the nearest
/// nanosecond, exactly. None for anything else, or beyond the range of `Duration`.
[[nodiscard]] std::optional<Duration> parse_decimal_seconds(std::string_view text);

}  // namespace geoflow::tools
