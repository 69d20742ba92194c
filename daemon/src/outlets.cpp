#include "src/outlets.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

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

Result<std::unique_ptr<Outlets>> Outlets::open(EventLoop& loop, const Config& config,
                                               std::uint32_t clock_flags,
                                               service::GivenSockets given,
                                               ControlHandlers handlers) {
  // NOLINTNEXTLINE(cppcoreguidelines-owning-memory): private constructor
  std::unique_ptr<Outlets> outlets{new Outlets};
  auto opened = outlets->open_all(loop, config, clock_flags, std::move(given), std::move(handlers));
  if (!opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  return outlets;
}

Result<void> Outlets::open_all(EventLoop& loop, const Config& config, std::uint32_t clock_flags,
                               service::GivenSockets given, ControlHandlers handlers) {
  Result<void> opened;
  if (given.pose || !config.socket.pose.empty()) {
    opened = PoseServer::create(loop, config.socket, clock_flags, std::move(given.pose))
                 .map([this](auto server) { poses_ = std::move(server); });
  }
  if (opened && (given.control || !config.socket.control.empty())) {
    opened =
        ControlServer::create(loop, config.socket, std::move(handlers), std::move(given.control))
            .map([this](auto server) { control_ = std::move(server); });
  }
  if (opened && config.ros.publish) {
    opened = bus::RosBus::start(config.ros).map([this](auto bus) { bus_ = std::move(bus); });
  }
  return opened;
}

void Outlets::publish(const geoflow_pose& pose) {
  if (control_) {
    control_->publish(pose);
  }
  publish_propagated(pose);
}

void Outlets::publish_propagated(const geoflow_pose& pose) {
  if (poses_) {
    poses_->publish(pose);
  }
  if (bus_) {
    bus_->publish(pose);
  }
}

void Outlets::publish(const Images& images, const Calibration& calibration) {
  if (!poses_) {
    return;
  }
  for (const StreamedFrame& frame : frames_.publish(images, calibration, poses_->wanted_frames())) {
    poses_->publish(frame);
  }
}

void Outlets::publish(const MapCloud& cloud) {
  if (!poses_) {
    return;
  }
  if (const auto frame = frames_.publish(cloud)) {
    poses_->publish(*frame);
  }
}

void Outlets::set_limits(const SocketConfig& config) {
  if (poses_) {
    poses_->set_limits(config);
  }
  if (control_) {
    control_->set_limits(config);
  }
}

void Outlets::check_timeouts() {
  if (poses_) {
    poses_->check_timeouts();
  }
  if (control_) {
    control_->check_timeouts();
  }
}

void Outlets::finish(geoflow_end_reason reason) {
  if (poses_) {
    poses_->finish(reason);
  }
}

void Outlets::report(const service::Observation& seen, const std::string& summary) {
  if (bus_) {
    bus_->report(seen, summary);
  }
}

void Outlets::add_status(nlohmann::json& status) const {
  status["pose_socket"] = poses_ ? poses_->status() : nlohmann::json{};
  status["control_clients"] = control_ ? control_->client_count() : 0;
  if (bus_) {
    status["ros"] = {{"trouble", bus_->trouble()},
                     {"published", bus_->published()},
                     {"readers", bus_->readers()}};
  }
}

}  // namespace geoflow::daemon
