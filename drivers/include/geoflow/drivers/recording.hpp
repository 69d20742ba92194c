#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

/// Recorded streams behind the same ports as devices.
namespace geoflow::drivers {

/// Which topics and frames of a rosbag2 recording carry what. An empty name: not wanted.
struct TopicNames {
  std::string color = "/camera/color/image_raw";
  std::string depth = "/camera/aligned_depth_to_color/image_raw";
  std::string camera_info = "/camera/color/camera_info";
  std::string imu = "/camera/imu";
  std::string legs = "/joint_foot";      ///< sensor_msgs/JointState: 12 joints, then 4 foot forces
  std::string odometry = "/robot_odom";  ///< nav_msgs/Odometry: its twist is the body velocity
  std::string base_frame = "base_link";  ///< frame_id in /tf_static
};

struct RecordingOptions {
  std::filesystem::path path;  ///< the recording's directory (or file, where a format is one file)
  /// A folder with Kalibr files; none: the recording's own folder, then what the recording itself
  /// says.
  std::optional<std::filesystem::path> calibration{};
  TopicNames topics{};
  /// What the frames of a CAN log mean; none: the .dbc file beside it, then config/go2_legs.dbc.
  std::optional<std::filesystem::path> can_dictionary{};
  std::optional<std::filesystem::path> faults{};  ///< a fault script (docs/fault-scripts.md)
  std::uint64_t fault_seed = 0;
  /// Colour images are decoded to kGray8 (cheaper for JPEG, and what the estimator wants); else to
  /// kBgr8.
  bool color_as_gray = false;
  /// Samples decoded ahead of delivery on a thread of their own.
  std::size_t prefetch = 8;
};

/// One stream found in a recording.
struct StreamSummary {
  std::string name;  ///< topic or list file
  std::string type;  ///< `color`, `depth`, `imu`, … or the message type
  std::uint64_t count = 0;
  std::optional<StreamId> stream{};  ///< what it is delivered as; none: it is not read
};

struct RecordingInfo {
  std::string format;  ///< `tum`, `rosbag2`, `openloris`, `scannet`, `oni`, `candump`, `euroc`
  HostTime start;      ///< stamp of the first sample, on the recording's time line
  HostTime end;        ///< stamp of the last sample
  std::vector<StreamSummary> streams;

  /// Whether any stream is delivered as `stream`.
  [[nodiscard]] bool has(StreamId stream) const noexcept;
};

/// What decoding cost. Images only; all other samples are free.
struct DecodeStatistics {
  std::uint64_t images = 0;
  Duration total{};    ///< on the decoding thread, which runs beside the caller of step() or play()
  Duration longest{};  ///< of one image
  Duration waited{};   ///< what step() or play() waited because no decoded sample was ready
};

/// The recorded-stream HAL: the three ports over one recording.
///
/// Samples are read and decoded ahead by a thread of its own, and delivered in the recording's
/// order on the thread that calls step() or play(): thread-bound to that one. The ports' start,
/// stop and health, and decode_statistics and recent_errors, may be called from one other thread,
/// but not from inside a sink. The ports live as long as this.
class RecordedStreams {
 public:
  /// Finds out what kind of recording it is by its content, opens it, finds its calibration and,
  /// where asked for, puts a fault script on it. Errors name the file, line and key concerned, or
  /// list what was looked for.
  [[nodiscard]] static Result<std::unique_ptr<RecordedStreams>> open(
      const RecordingOptions& options);

  RecordedStreams(const RecordedStreams&) = delete;
  RecordedStreams& operator=(const RecordedStreams&) = delete;
  ~RecordedStreams();

  [[nodiscard]] const RecordingInfo& info() const;
  /// A recording without images has the default one.
  [[nodiscard]] const Calibration& calibration() const;
  /// Poses of the colour camera that the recording holds as its own truth (ScanNet), in a world of
  /// its own, on the recording's time line; empty where it has none.
  [[nodiscard]] const Trajectory& reference() const;
  /// Of the samples delivered so far.
  [[nodiscard]] FaultCounters faults() const;

  [[nodiscard]] DepthCamera& camera();
  [[nodiscard]] Imu* imu();  ///< null where the recording has none
  [[nodiscard]] Legs*
  legs();  ///< null where the recording has neither leg samples nor body velocities

  /// Delivers the next sample to the started sinks, as fast as it can; false at the end. An Error
  /// concerns one sample that was rejected (file and line or message number); the next step() goes
  /// on behind it.
  [[nodiscard]] Result<bool> step();

  /// The arrival time of the last sample delivered: the clock of an unpaced replay. Before the
  /// first: info().start. Thread-safe.
  [[nodiscard]] HostTime now() const;

  /// Delivers what is left in step with HostClock, `speed` times as fast as it was recorded (> 0),
  /// with arrival times (and device times of streams stamped by the host) shifted so that the first
  /// one is now. Returns at the end or when stopped. Rejected samples are counted and kept in
  /// recent_errors().
  [[nodiscard]] Result<void> play(const std::stop_token& stop, double speed = 1.0);

  /// The time of the next sample while play() waits for it, none while it works. Thread-safe.
  [[nodiscard]] std::optional<HostTime> waits_until() const;

  /// Undoes the shift of play(): a time on the recording's own time line. Identity after step()
  /// alone. Thread-safe.
  [[nodiscard]] HostTime to_recording_time(HostTime t) const;

  [[nodiscard]] DecodeStatistics decode_statistics() const;

  /// The newest texts of rejected samples, oldest first, at most 32; how many there were, health()
  /// says.
  [[nodiscard]] std::vector<std::string> recent_errors() const;

 private:
  class Implementation;
  explicit RecordedStreams(std::unique_ptr<Implementation> implementation);
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace geoflow::drivers
