#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {

/// One pose as a client received it.
struct ReceivedPose {
  geoflow_pose pose{};
  std::uint32_t dropped = 0;  ///< poses missed since the last one, for being slow
  HostTime t_received;
};

/// A client of the pose socket. Thread-bound.
class PoseClient {
 public:
  struct Options {
    std::string name;         ///< for the daemon's log
    double max_rate_hz = 0;   ///< 0: every pose
    bool propagated = false;  ///< poses at each IMU sample instead of each frame
  };

  /// Connects and shakes hands. kUnavailable where no daemon listens, or it refuses (with its
  /// reason); kNotFound where there is no socket; kInvalidData where what answers is no geoflowd.
  [[nodiscard]] static Result<PoseClient> connect(const std::filesystem::path& socket,
                                                  const Options& options);

  [[nodiscard]] const geoflow_welcome& welcome() const noexcept { return welcome_; }

  /// The daemon has said that nothing more follows.
  struct Ended {
    std::uint32_t reason = 0;  ///< geoflow_end_reason; 0: it closed without a word
  };
  /// `timeout` passed, or a signal came.
  struct TimedOut {};
  using Received = std::variant<ReceivedPose, Ended, TimedOut>;

  /// Waits for the next record at most `timeout`. Records of unknown type are skipped.
  [[nodiscard]] Result<Received> receive(Duration timeout);

 private:
  PoseClient(UniqueFd fd, const geoflow_welcome& welcome) : fd_{std::move(fd)}, welcome_{welcome} {}

  UniqueFd fd_;
  geoflow_welcome welcome_{};
};

}  // namespace geoflow::daemon
