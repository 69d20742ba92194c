#include "replay/session.hpp"

#include <cstdint>
#include <optional>
#include <stop_token>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/lock_step_runner.hpp"
#include "geoflow/daemon/propagated_pose.hpp"
#include "geoflow/daemon/run.hpp"
#include "geoflow/daemon/run_statistics.hpp"
#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

namespace geoflow::tools {
namespace {

std::uint64_t color_images(const drivers::RecordingInfo& info) {
  std::uint64_t images = 0;
  for (const auto& stream : info.streams) {
    images += stream.stream == drivers::StreamId::kColor ? stream.count : 0;
  }
  return images;
}

}  // namespace

Result<ReplayResult> replay(const daemon::Config& config, const ReplayProgress& progress,
                            bool propagate) {
  const HostTime begin = HostClock::now();
  auto opened = daemon::open_run(config);
  if (!opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  ReplayResult result;
  result.run = std::move(*opened);
  if (const std::optional<Error>& refused = result.run.map_refused) {
    return tl::unexpected{*refused};
  }
  std::stop_source stop;
  std::uint64_t frames = 0;
  const std::uint64_t total = color_images(result.run.streams->info());
  const auto take = [&](const SyncedPacket& /*packet*/, const PoseEstimate& estimate) {
    result.first_pose = frames == 0 ? HostClock::now() - begin : result.first_pose;
    if (daemon::has_pose(estimate.status)) {
      result.estimates.push_back(estimate);
      result.live_base.push_back({estimate.t, estimate.T_map_odom * estimate.T_odom_base});
    }
    if (!progress(++frames, total)) {
      result.interrupted = true;
      stop.request_stop();
    }
  };
  daemon::PropagatedHandler take_propagated;
  if (propagate) {
    take_propagated = [&](const daemon::PropagatedPose& propagated) {
      const PoseEstimate& estimate = propagated.estimate;
      result.imu_base.push_back({estimate.t, estimate.T_map_odom * estimate.T_odom_base});
    };
  }
  const HostTime ready = HostClock::now();
  auto done =
      daemon::LockStepRunner{result.run, config, take, take_propagated}.run(stop.get_token());
  result.elapsed = HostClock::now() - ready;
  if (!done) {
    return tl::unexpected{std::move(done.error())};
  }
  result.final_base = result.run.core->final_trajectory();
  return result;
}

Trajectory camera_trajectory(const Trajectory& base, const Calibration& calibration) {
  const SE3 T_base_cam = calibration.T_base_cam.value_or(SE3{});
  Trajectory camera = base;
  for (StampedPose& stamped : camera) {
    stamped.pose = stamped.pose * T_base_cam;
  }
  return camera;
}

}  // namespace geoflow::tools
