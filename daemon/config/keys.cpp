#include "config/keys.hpp"

#include <string>
#include <string_view>
#include <vector>

#include "geoflow/daemon/config.hpp"
#include "geoflow/drivers/can_legs.hpp"
#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/nearest_name.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

// The bounds below are the values for which the code is meant and tested; each is stated with its
// key in config/geoflow.toml. NOLINTBEGIN(readability-magic-numbers)
namespace geoflow::daemon {
namespace {

constexpr double kLargestSeed = 9e15;  // whole numbers that a double holds exactly

void bind_source(SourceConfig& c, std::vector<Key>& keys) {
  keys.push_back({"source.replay", &c.replay});
  keys.push_back({"source.calibration", &c.calibration});
  keys.push_back({"source.faults", &c.faults});
  keys.push_back({"source.fault_seed", &c.fault_seed, 0, kLargestSeed});
  keys.push_back({"source.realtime", &c.realtime});
  keys.push_back({"source.loop", &c.loop});
  keys.push_back({"source.camera", &c.camera});
  keys.push_back({"source.legs", &c.legs});
  keys.push_back({"source.imu", &c.imu});
}

void bind_topics(drivers::TopicNames& c, std::vector<Key>& keys) {
  keys.push_back({"topics.color", &c.color});
  keys.push_back({"topics.depth", &c.depth});
  keys.push_back({"topics.camera_info", &c.camera_info});
  keys.push_back({"topics.imu", &c.imu});
  keys.push_back({"topics.legs", &c.legs});
  keys.push_back({"topics.odometry", &c.odometry});
  keys.push_back({"topics.base_frame", &c.base_frame});
}

void bind_d435i(CameraConfig& c, std::vector<Key>& keys) {
  keys.push_back({"d435i.transport", &c.transport});
  keys.push_back({"d435i.serial", &c.serial});
  keys.push_back({"d435i.width", &c.width, 256, 1280});
  keys.push_back({"d435i.height", &c.height, 100, 800});
  keys.push_back({"d435i.rate_hz", &c.rate_hz, 6, 90});
  keys.push_back({"d435i.accel_hz", &c.accel_hz, 63, 400});
  keys.push_back({"d435i.gyro_hz", &c.gyro_hz, 200, 400});
  keys.push_back({"d435i.emitter", &c.emitter});
  keys.push_back({"d435i.laser_power_mw", &c.laser_power_mw, 0, 360});
  keys.push_back({"d435i.exposure_us", &c.exposure_us, 0, 165000});
}

void bind_openni2(OpenNi2Config& c, std::vector<Key>& keys) {
  keys.push_back({"openni2.uri", &c.uri});
  keys.push_back({"openni2.width", &c.width, 160, 1920});
  keys.push_back({"openni2.height", &c.height, 120, 1200});
  keys.push_back({"openni2.rate_hz", &c.rate_hz, 5, 120});
}

void bind_can(drivers::CanLegsOptions& c, std::vector<Key>& keys) {
  keys.push_back({"can.interfaces", &c.interfaces});
  keys.push_back({"can.dictionary", &c.dictionary});
  keys.push_back({"can.log", &c.log});
}

void bind_dds(drivers::DdsRobotOptions& c, std::vector<Key>& keys) {
  keys.push_back({"dds.interface", &c.interface});
  keys.push_back({"dds.domain", &c.domain, 0, 230});
  keys.push_back({"dds.topic", &c.topic});
}

void bind_synchroniser(timesync::SynchroniserConfig& c, std::vector<Key>& keys) {
  keys.push_back({"synchroniser.depth_tolerance_s", &c.depth_tolerance, 0, 1});
  keys.push_back({"synchroniser.share_depth", &c.share_depth});
  keys.push_back({"synchroniser.max_wait_s", &c.max_wait, 0, 10});
  keys.push_back({"synchroniser.silent_after_s", &c.silent_after, 0.001, 60});
  keys.push_back({"synchroniser.blind_interval_s", &c.blind_interval, 0.001, 1});
  keys.push_back({"synchroniser.max_step_s", &c.max_step, 0.1, 3600});
  keys.push_back({"synchroniser.frame_capacity", &c.frame_capacity, 2, 64});
  keys.push_back({"synchroniser.sample_capacity", &c.sample_capacity, 16, 65536});
  keys.push_back({"synchroniser.clock.first_bound_s", &c.clock.first_bound, 0, 1});
  keys.push_back({"synchroniser.clock.min_delay_s", &c.clock.min_delay, 0, 1});
  keys.push_back({"synchroniser.clock.resolution_s", &c.clock.resolution, 1e-9, 0.1});
  keys.push_back({"synchroniser.clock.max_delay_s", &c.clock.max_delay, 0.001, 60});
  keys.push_back({"synchroniser.clock.max_drift", &c.clock.max_drift, 0, 0.01});
}

// The structured bindings of the estimator's structs name every member: one that is added without a
// key here does not compile.

void bind_features(slam::FeatureConfig& c, std::vector<Key>& keys) {
  auto& [cell_px, per_cell, described, threshold, mask_radius_px] = c;
  keys.push_back({"slam.features.cell_px", &cell_px, 8, 200});
  keys.push_back({"slam.features.features_per_cell", &per_cell, 1, 20});
  keys.push_back({"slam.features.described_per_cell", &described, 1, 20});
  keys.push_back({"slam.features.fast_threshold", &threshold, 1, 200});
  keys.push_back({"slam.features.mask_radius_px", &mask_radius_px, 0, 100});
}

void bind_flow(slam::FlowConfig& c, std::vector<Key>& keys) {
  auto& [window_px, prior_window_px, prior_levels, levels, forward_backward_px, fundamental_px] = c;
  keys.push_back({"slam.flow.window_px", &window_px, 5, 61});
  keys.push_back({"slam.flow.prior_window_px", &prior_window_px, 5, 61});
  keys.push_back({"slam.flow.prior_levels", &prior_levels, 0, 6});
  keys.push_back({"slam.flow.levels", &levels, 0, 6});
  keys.push_back({"slam.flow.forward_backward_px", &forward_backward_px, 0.01, 20});
  keys.push_back({"slam.flow.fundamental_threshold_px", &fundamental_px, 0.1, 20});
}

void bind_pose(slam::PoseConfig& c, std::vector<Key>& keys) {
  auto& [pixel_sigma, minimum_inliers, pnp_px, targets, surfels, iterations] = c;
  keys.push_back({"slam.pose.pixel_sigma", &pixel_sigma, 0.01, 20});
  keys.push_back({"slam.pose.minimum_visual_inliers", &minimum_inliers, 6, 1000});
  keys.push_back({"slam.pose.pnp_threshold_px", &pnp_px, 0.1, 50});
  keys.push_back({"slam.pose.map_targets", &targets, 1, 20});
  keys.push_back({"slam.pose.gicp_surfels", &surfels, 50, 20000});
  keys.push_back({"slam.pose.iterations", &iterations, 1, 100});
}

void bind_keyframes(slam::KeyframeConfig& c, std::vector<Key>& keys) {
  auto& [translation_m, rotation_rad, overlap, maximum_interval] = c;
  keys.push_back({"slam.keyframes.translation_m", &translation_m, 0.001, 10});
  keys.push_back({"slam.keyframes.rotation_rad", &rotation_rad, 0.001, 3.14});
  keys.push_back({"slam.keyframes.overlap", &overlap, 0, 1});
  keys.push_back({"slam.keyframes.maximum_interval_s", &maximum_interval, 0.01, 3600});
}

void bind_mapping(slam::MappingConfig& c, std::vector<Key>& keys) {
  auto& [window, fixed, map_neighbours, iterations, depth_sigma] = c;
  keys.push_back({"slam.mapping.window", &window, 2, 100});
  keys.push_back({"slam.mapping.fixed", &fixed, 1, 200});
  keys.push_back({"slam.mapping.map_neighbours", &map_neighbours, 0, 50});
  keys.push_back({"slam.mapping.iterations", &iterations, 1, 100});
  keys.push_back({"slam.mapping.inverse_depth_sigma", &depth_sigma, 1e-5, 1});
}

void bind_slam(slam::Config& c, std::vector<Key>& keys) {
  auto& [switches, features, flow, pose, keyframes, mapping] = c;
  auto& [optical_flow, gicp, depth_to_map, imu, legs, rolling_shutter, loop_closing] = switches;
  keys.push_back({"slam.switches.optical_flow", &optical_flow});
  keys.push_back({"slam.switches.gicp", &gicp});
  keys.push_back({"slam.switches.depth_to_map", &depth_to_map});
  keys.push_back({"slam.switches.imu", &imu});
  keys.push_back({"slam.switches.legs", &legs});
  keys.push_back({"slam.switches.rolling_shutter", &rolling_shutter});
  keys.push_back({"slam.switches.loop_closing", &loop_closing});
  bind_features(features, keys);
  bind_flow(flow, keys);
  bind_pose(pose, keys);
  bind_keyframes(keyframes, keys);
  bind_mapping(mapping, keys);
}

void bind_socket(SocketConfig& c, std::vector<Key>& keys) {
  keys.push_back({"socket.pose", &c.pose});
  keys.push_back({"socket.control", &c.control});
  keys.push_back({"socket.mode", &c.mode, 0, 0777});
  keys.push_back({"socket.group", &c.group});
  keys.push_back({"socket.clients", &c.clients, 1, 256});
  keys.push_back({"socket.clients_per_user", &c.clients_per_user, 1, 256});
  keys.push_back({"socket.handshake_timeout_s", &c.handshake_timeout, 0.05, 60});
  keys.push_back({"socket.stall_timeout_s", &c.stall_timeout, 0.05, 3600});
}

void bind_ros(RosConfig& c, std::vector<Key>& keys) {
  keys.push_back({"ros.publish", &c.publish});
  keys.push_back({"ros.interface", &c.publisher.interface});
  keys.push_back({"ros.domain", &c.publisher.domain, 0, 230});
  keys.push_back({"ros.name", &c.publisher.name});
  keys.push_back({"ros.map_frame", &c.publisher.map_frame});
  keys.push_back({"ros.odom_frame", &c.publisher.odom_frame});
  keys.push_back({"ros.base_frame", &c.publisher.base_frame});
  keys.push_back({"ros.rate_hz", &c.rate_hz, 0, 1000});
  keys.push_back({"ros.velocity_sigma_mps", &c.velocity_sigma_mps, 1e-6, 100});
  keys.push_back({"ros.angular_velocity_sigma_radps", &c.angular_velocity_sigma_radps, 1e-6, 100});
}

void bind_pipeline(PipelineConfig& c, std::vector<Key>& keys) {
  keys.push_back({"pipeline.packet_queue", &c.packet_queue, 1, 64});
  keys.push_back({"pipeline.image_queue", &c.image_queue, 2, 64});
  keys.push_back({"pipeline.sample_queue", &c.sample_queue, 16, 65536});
  keys.push_back({"pipeline.priority", &c.priority, 0, 99});
  keys.push_back({"pipeline.lock_memory", &c.lock_memory});
}

void bind_map(MapConfig& c, std::vector<Key>& keys) {
  keys.push_back({"map.file", &c.file});
  keys.push_back({"map.save_interval_s", &c.save_interval, 0, 86400});
}

}  // namespace

std::vector<Key> bind_keys(Config& config) {
  std::vector<Key> keys;
  bind_source(config.source, keys);
  bind_topics(config.topics, keys);
  bind_d435i(config.d435i, keys);
  bind_openni2(config.openni2, keys);
  bind_can(config.can, keys);
  bind_dds(config.dds, keys);
  bind_synchroniser(config.synchroniser, keys);
  bind_slam(config.slam, keys);
  bind_socket(config.socket, keys);
  bind_ros(config.ros, keys);
  bind_pipeline(config.pipeline, keys);
  bind_map(config.map, keys);
  return keys;
}

std::string nearest_key(const std::vector<Key>& keys, std::string_view unknown) {
  std::vector<std::string_view> names;
  names.reserve(keys.size());
  for (const Key& key : keys) {
    names.emplace_back(key.name);
  }
  return std::string{nearest_name(names, unknown)};
}

}  // namespace geoflow::daemon
// NOLINTEND(readability-magic-numbers)
