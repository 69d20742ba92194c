#pragma once

#include <bitset>
#include <filesystem>
#include <string_view>
#include <vector>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

/// Fault scripts: TOML with one [[fault]] table per fault (docs/fault-scripts.md).
namespace geoflow::drivers::faults {

/// One entry of a script. Only what its kind uses is set.
struct Fault {
  FaultKind kind = FaultKind::kDrop;
  std::bitset<kStreamCount> streams;  ///< which StreamIds it touches
  Duration from{};                    ///< since the recording's start
  Duration until = Duration::max();   ///< since the recording's start, itself outside
  double probability = 1;             ///< of touching a sample inside that time
  Duration delay{};                   ///< kDelay: at least this
  Duration jitter{};                  ///< kDelay: and up to this more, uniformly
  double keep = 0.5;                  ///< kTruncate: part of the bytes that is left
  Duration offset{};                  ///< kClockOffset, kClockJump
  double drift_ppm = 0;               ///< kClockDrift: microseconds per second, positive is fast
  Duration first_wrap{};  ///< kClockWrap: when the counter first starts again, since the start

  [[nodiscard]] bool touches(StreamId stream) const noexcept {
    return streams.test(static_cast<std::size_t>(stream));
  }
};

/// At most 64 faults. Errors name `file`, line and key. Pure.
[[nodiscard]] Result<std::vector<Fault>> parse_script(std::string_view file,
                                                      std::string_view content);

/// The same of a file of at most 1 MiB.
[[nodiscard]] Result<std::vector<Fault>> load_script(const std::filesystem::path& path);

}  // namespace geoflow::drivers::faults
