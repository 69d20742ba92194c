#include "view/follower.hpp"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <variant>

#include <nlohmann/json.hpp>
#include <tl/expected.hpp>

#include "geoflow/daemon/control_client.hpp"
#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/pose_client.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/daemon_text.hpp"
#include "geoflow/tools/pose_text.hpp"

#include "view/live_state.hpp"
#include "view/map_scene.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

constexpr auto kWaitSlice = std::chrono::milliseconds{100};
constexpr auto kStatusPeriod = std::chrono::seconds{1};
constexpr auto kReplyTimeout = std::chrono::seconds{5};

std::string line_of(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace

Follower::Follower(FollowerOptions options, LiveState& state, MapScene& map)
    : options_{std::move(options)}, state_{state}, map_{map} {}

Result<void> Follower::connect() {
  auto control = daemon::ControlClient::connect(options_.control_socket);
  if (!control) {
    return tl::unexpected{std::move(control.error())};
  }
  auto poses = daemon::PoseClient::connect(
      options_.pose_socket, {.name = "geoflow view", .max_rate_hz = options_.rate_hz});
  if (!poses) {
    return tl::unexpected{std::move(poses.error())};
  }
  if (!std::ranges::equal(poses->welcome().instance, instance_)) {
    std::ranges::copy(poses->welcome().instance, instance_.begin());
    state_.clear_way();
  }
  control_.emplace(*std::move(control));
  poses_.emplace(*std::move(poses));
  asked_.reset();
  put_link(true, "");
  return {};
}

Result<void> Follower::take_pose() {
  const auto received = poses_->receive(kWaitSlice);
  if (!received) {
    return tl::unexpected{received.error()};
  }
  if (std::holds_alternative<daemon::PoseClient::Ended>(*received)) {
    return fail(ErrorCode::kUnavailable, "the daemon has ended");
  }
  const auto* pose = std::get_if<daemon::ReceivedPose>(&*received);
  if (pose == nullptr) {
    return {};
  }
  if (std::exchange(resets_, pose->pose.reset_counter) != pose->pose.reset_counter) {
    state_.clear_way();
  }
  if (daemon::has_pose(static_cast<TrackingStatus>(pose->pose.status))) {
    state_.add_to_way(Vector3d{&pose->pose.p_odom_base[0]});
  }
  state_.put("pose", line_of(pose_object(*pose)));
  return {};
}

Result<void> Follower::ask_status() {
  const HostTime now = HostClock::now();
  if (asked_ && now - *asked_ < kStatusPeriod) {
    return {};
  }
  asked_ = now;
  return control_->request({{"cmd", "status"}}, kReplyTimeout).map([this](const json& reply) {
    const json status = reply.value("status", json::object());
    follow_map(status);
    state_.put("status", line_of(status));
  });
}

void Follower::follow_map(const json& status) {
  const std::filesystem::path file = text_at(status, "map.file");
  std::error_code none;
  const auto time = file.empty() ? map_time_ : std::filesystem::last_write_time(file, none);
  if (!none && time != map_time_) {
    map_time_ = time;
    map_.show(file);
    state_.put("map", line_of({{"file", file.string()}}));
  }
}

void Follower::put_link(bool up, const std::string& why) {
  std::string link = line_of({{"up", up}, {"why", why}});
  if (link_ != link) {
    link_ = link;
    state_.put("link", std::move(link));
  }
}

void Follower::lose(const std::string& why) {
  poses_.reset();
  control_.reset();
  put_link(false, why);
}

bool Follower::step() {
  const auto work = [this]() -> Result<void> {
    return poses_ ? ask_status().and_then([this] { return take_pose(); }) : connect();
  };
  if (const auto done = work(); !done) {
    lose(done.error().message);
  }
  return poses_.has_value();
}

}  // namespace geoflow::tools
