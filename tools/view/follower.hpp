#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/control_client.hpp"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "view/live_state.hpp"
#include "view/map_scene.hpp"

namespace geoflow::tools {

struct FollowerOptions {
  std::filesystem::path pose_socket;
  std::filesystem::path control_socket;
  double rate_hz = 0;  ///< poses a second at most
};

/// Keeps what pages show as a running daemon is: an ordinary client of both sockets, which connects
/// again where the daemon has gone. Events are those of docs/view.md. Thread-bound.
class Follower {
 public:
  /// `state` and `map` must outlive it.
  Follower(FollowerOptions options, LiveState& state, MapScene& map);

  /// Works for a moment: connects where a connection is missing; otherwise takes a pose, and asks
  /// for the status when it is time. False where there is no daemon: then it is time to wait.
  [[nodiscard]] bool step();

 private:
  [[nodiscard]] Result<void> connect();
  [[nodiscard]] Result<void> take_pose();
  [[nodiscard]] Result<void> ask_status();
  void follow_map(const nlohmann::json& status);
  void put_link(bool up, const std::string& why);
  void lose(const std::string& why);

  FollowerOptions options_;
  LiveState& state_;
  MapScene& map_;
  std::optional<daemon::PoseClient> poses_;
  std::optional<daemon::ControlClient> control_;
  std::optional<HostTime> asked_;
  std::optional<std::string> link_;  ///< as it was told last
  std::array<std::uint8_t, 16> instance_{};
  std::uint32_t resets_ = 0;
  std::filesystem::file_time_type map_time_{};  ///< of the map file that pages were told of
};

}  // namespace geoflow::tools
