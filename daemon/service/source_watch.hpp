#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon::service {

/// How one source of samples is, as its driver says.
struct SourceReport {
  std::string name{};  ///< camera, imu or legs
  SourceHealth health{};
};

/// And whether anything comes from it, which a driver need not notice.
struct WatchedSource {
  std::string name{};
  SourceHealth health{};
  std::optional<Duration> since_sample{};  ///< age of the newest sample; none: there was none yet
  /// Of the newest sample or, where there was none, of the first look at the source; none: it is
  /// not silent, which means no more than 1.5 s of this.
  std::optional<Duration> silent{};
};

/// Tells which sources are silent, from how their counts of samples grow. Thread-compatible; reads
/// no clock.
class SourceWatch {
 public:
  /// To be called several times a second: ages are told to this resolution.
  void look(const std::vector<SourceReport>& sources, HostTime now);
  /// As they were at the last look.
  [[nodiscard]] const std::vector<WatchedSource>& sources() const noexcept { return sources_; }

 private:
  struct Count {
    std::string name;
    std::uint64_t delivered = 0;
    HostTime grew;
    bool ever = false;
  };
  [[nodiscard]] const Count& count(const SourceReport& source, HostTime now);

  std::vector<Count> counts_;
  std::vector<WatchedSource> sources_;
};

/// In words, as in `IMU ok` and `legs silent 2 s (no interface can0)`.
[[nodiscard]] std::string describe(const WatchedSource& source);
/// The driver's state, or silent.
[[nodiscard]] std::string state_name(const WatchedSource& source);

/// For the status reply: name to `state` (state_name()), `last_sample_s` ago, `reason`
/// and the counters.
[[nodiscard]] nlohmann::json to_json(const std::vector<WatchedSource>& sources);

}  // namespace geoflow::daemon::service
