#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

#include "bus/ros_bus.hpp"
#include "map/map_cloud.hpp"
#include "server/control_connection.hpp"
#include "server/control_server.hpp"
#include "server/event_loop.hpp"
#include "server/pose_server.hpp"
#include "service/given_sockets.hpp"
#include "service/status_line.hpp"
#include "stream/frame_streams.hpp"

namespace geoflow::daemon {

/// Where poses and images go: to the clients of both sockets and, if configured, to machines that
/// run ROS 2. Thread-bound: the loop's.
class Outlets {
 public:
  /// Opens what `config` names; sockets that are `given` stand in for configured ones.
  /// `clock_flags` are geoflow_clock_flags. Errors as ListeningSocket::open(), RosBus::start().
  [[nodiscard]] static Result<std::unique_ptr<Outlets>> open(EventLoop& loop, const Config& config,
                                                             std::uint32_t clock_flags,
                                                             service::GivenSockets given,
                                                             ControlHandlers handlers);

  /// A frame's pose.
  void publish(const geoflow_pose& pose);
  /// One that was carried on to an IMU sample.
  void publish_propagated(const geoflow_pose& pose);
  /// A frame's images, to those who want them.
  void publish(const Images& images, const Calibration& calibration);
  /// The map's surfaces, likewise.
  void publish(const MapCloud& cloud);
  /// What of these anybody wants (geoflow_want, or-ed).
  [[nodiscard]] std::uint32_t wanted_frames() const { return poses_ ? poses_->wanted_frames() : 0; }

  /// Answers a client of the control socket, which there is then.
  void conclude(const Asker& asker, const Result<nlohmann::json>& outcome) {
    control_->conclude(asker, outcome);
  }
  void set_limits(const SocketConfig& config);
  /// Cuts off clients whose time is over. To be called a few times a second.
  void check_timeouts();
  /// Tells clients of the pose socket the end.
  void finish(geoflow_end_reason reason);
  /// None of them is left.
  [[nodiscard]] bool is_done() const { return !poses_ || poses_->client_count() == 0; }

  /// Tells machines that run ROS 2 how the daemon is.
  void report(const service::Observation& seen, const std::string& summary);
  /// Why they cannot be told; empty where they can.
  [[nodiscard]] std::string trouble() const { return bus_ ? bus_->trouble() : std::string{}; }
  /// Adds `pose_socket`, `control_clients` and `ros` to the status reply.
  void add_status(nlohmann::json& status) const;

 private:
  Outlets() = default;
  [[nodiscard]] Result<void> open_all(EventLoop& loop, const Config& config,
                                      std::uint32_t clock_flags, service::GivenSockets given,
                                      ControlHandlers handlers);

  std::unique_ptr<PoseServer> poses_;       // null: none is wanted
  std::unique_ptr<ControlServer> control_;  // likewise
  std::unique_ptr<bus::RosBus> bus_;        // likewise
  FrameStreams frames_;
};

}  // namespace geoflow::daemon
