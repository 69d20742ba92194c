#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/drivers/can_legs.hpp"
#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/drivers/ros_publisher.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/slam/config.hpp"
#include "geoflow/timesync/synchroniser_config.hpp"

/// The daemon's configuration: plain structs, and the TOML files that set them. config/geoflow.toml
/// documents every key. Functions here are pure apart from reading the named file; thread-safe.
namespace geoflow::daemon {

/// Where samples come from. An empty path: not given.
struct SourceConfig {
  std::filesystem::path replay;       ///< a recording
  std::filesystem::path calibration;  ///< a folder with Kalibr files
  std::filesystem::path faults;       ///< a fault script for the recording
  std::uint64_t fault_seed = 0;
  bool realtime = true;  ///< at the pace it was recorded; else as fast as it can be worked on
  bool loop = false;     ///< begin again at its end
  std::string camera{};  ///< `d435i` (with its IMU) or `openni2`; empty: the recording's
  std::string legs{};    ///< `can` or `dds`: from there; empty: from the recording
  std::string imu{};     ///< `dds`: the body's IMU instead of the camera's; empty: the recording's
};

// NOLINTBEGIN(readability-magic-numbers): each default is named by its member
/// How a D435i is run (docs/d435i.md).
struct CameraConfig {
  std::string transport = "auto";  ///< auto, v4l2 or libusb
  std::string serial;              ///< what USB shows as serial number; empty: the first one found
  int width = 640;                 ///< of colour and depth [px]
  int height = 480;                ///< [px]
  int rate_hz = 30;
  int accel_hz = 200;
  int gyro_hz = 200;
  bool emitter = true;       ///< the pattern projector
  int laser_power_mw = 150;  ///< its power
  int exposure_us = 0;       ///< of depth; 0: automatic
};

/// How a camera of OpenNI2's is run (docs/openni2.md).
struct OpenNi2Config {
  std::string uri;   ///< OpenNI's name of the device, or an .oni file; empty: the first device
  int width = 640;   ///< of colour and depth [px]
  int height = 480;  ///< [px]
  int rate_hz = 30;
};

/// The two sockets and what their clients may do.
struct SocketConfig {
  std::filesystem::path pose = "/run/geoflow/pose.sock";
  std::filesystem::path control = "/run/geoflow/ctl.sock";
  int mode = 0660;            ///< permissions of both
  std::string group;          ///< owning group of both; empty: the daemon's own
  int clients = 32;           ///< at most, on each socket
  int clients_per_user = 24;  ///< of them at most; the rest is for other users
  Duration handshake_timeout = std::chrono::seconds{2};  ///< for HELLO
  Duration stall_timeout =
      std::chrono::seconds{5};  ///< a client that reads nothing for so long is cut off
};

/// The pose for machines that run ROS 2 (docs/ros.md).
struct RosConfig {
  bool publish = false;
  drivers::RosPublisherOptions publisher{};
  double rate_hz = 50;              ///< of poses, at most; 0: every one
  double velocity_sigma_mps = 0.1;  ///< standard deviation that the twist is given, each direction
  double angular_velocity_sigma_radps = 0.1;
};

/// Threads and queues of the live pipeline.
struct PipelineConfig {
  int packet_queue = 4;     ///< packets that may wait for the estimator; one more drops the oldest
  int image_queue = 8;      ///< images of each kind that may wait for the synchroniser; likewise
  int sample_queue = 1024;  ///< IMU samples, and leg samples, that may wait for the synchroniser
  int priority = 0;         ///< real-time, of the source's, synchroniser's and estimator's threads;
                            ///< 0: none
  bool lock_memory = false;  ///< what the daemon has in memory stays there
};

/// The map that outlives the daemon.
struct MapConfig {
  std::filesystem::path file;                         ///< empty: none
  Duration save_interval = std::chrono::seconds{60};  ///< while it changes; zero: at the end only
};
// NOLINTEND(readability-magic-numbers)

struct Config {
  SourceConfig source;
  drivers::TopicNames topics;
  CameraConfig d435i;
  OpenNi2Config openni2;
  drivers::CanLegsOptions can;
  drivers::DdsRobotOptions dds;
  timesync::SynchroniserConfig synchroniser;
  slam::Config slam;
  SocketConfig socket;
  RosConfig ros;
  PipelineConfig pipeline;
  MapConfig map;
};

/// Defaults overlaid by a TOML file. Errors: kNotFound, kSystem for the file; kInvalidArgument,
/// naming file, line and key, for a syntax error, an unknown key (with the nearest known one), a
/// wrong type or a value out of range.
[[nodiscard]] Result<Config> load_config(const std::filesystem::path& file);

/// The same from text; `name` stands for the file in messages.
[[nodiscard]] Result<Config> parse_config(std::string_view text, std::string_view name);

/// Overlays one `section.key=value`, value as in TOML (a bare word is taken as a string). Errors as
/// above.
[[nodiscard]] Result<void> set_key(Config& config, std::string_view assignment);

/// load_config(), or the defaults where no file is named (an empty path), overlaid by `settings` in
/// their order: a program's --config and --set options. Errors as above.
[[nodiscard]] Result<Config> configure(const std::filesystem::path& file,
                                       const std::vector<std::string>& settings);

/// One key as it stands, value in TOML's notation.
struct ConfigValue {
  std::string key;
  std::string value;
};

/// Every key there is, with its value in `config`.
[[nodiscard]] std::vector<ConfigValue> list_keys(const Config& config);

}  // namespace geoflow::daemon
