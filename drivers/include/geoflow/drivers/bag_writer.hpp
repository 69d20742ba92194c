#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

/// Recording to rosbag2 (docs/recordings.md).
namespace geoflow::drivers {

/// How a bag keeps its messages: both are rosbag2's own.
enum class BagStorage {
  kSqlite,  ///< a database: whole up to the last second however the recording ends
  kMcap,    ///< one file in chunks with checksums, which Foxglove opens as it is
};

struct BagWriterOptions {
  std::filesystem::path directory;  ///< is made; must not exist
  BagStorage storage = BagStorage::kSqlite;
  TopicNames topics{};  ///< under which names samples are written
  std::string camera_frame = "camera_color_optical_frame";
  std::string imu_frame = "camera_imu_optical_frame";
  std::string odom_frame = "odom";
  bool compress = false;      ///< every message, in MCAP every chunk, as a Zstandard frame
  int compression_level = 1;  ///< 1 (fast) to 19
  /// A transaction, in MCAP a chunk, ends after this much recorded time or this many bytes: what a
  /// power cut can cost.
  Duration commit_after = std::chrono::seconds{1};
  std::size_t commit_after_bytes = std::size_t{16} * 1024 * 1024;
  /// How the samples to come are stamped; kept in the bag, so that a replay treats them alike.
  StampInfo camera_stamps{};
  StampInfo imu_stamps{};
  StampInfo leg_stamps{};
};

/// A pose of one frame in another, and its velocity: nav_msgs/Odometry.
struct OdometrySample {
  SE3 T_parent_child;
  Vector3d v_child_mps = Vector3d::Zero();    ///< expressed in the child frame
  Vector3d w_child_radps = Vector3d::Zero();  ///< expressed in the child frame
};

/// Writes samples of all three ports, with the calibration, as standard ROS 2 messages:
/// `header.stamp` is the device's time, the bag's time of a message its arrival; reading gives both
/// back to the nanosecond. With every image goes a camera_info; /tf_static stands at the beginning.
///
/// Until close() the bag is a folder with a database and its write-ahead log, or with an MCAP file
/// without a summary, which readers open as it is, also after a power cut. Thread-safe; may wait
/// for the disk, so a live source needs a queue before it. The first failure is kept: from then on
/// samples are ignored, and status() and close() return it.
class BagWriter final : public CameraSink, public ImuSink, public LegSink {
 public:
  /// kInvalidArgument where the folder exists.
  [[nodiscard]] static Result<std::unique_ptr<BagWriter>> create(const BagWriterOptions& options,
                                                                 const Calibration& calibration);
  BagWriter(const BagWriter&) = delete;
  BagWriter& operator=(const BagWriter&) = delete;
  /// Closes; a failure then goes to the log.
  ~BagWriter() override;

  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override;
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override;
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override;
  void on_legs(const Arrival<LegClock, LegSample>& sample) override;
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) override;

  /// Adds a pose to `topic` (ground truth of a simulation, an estimate), in the odom frame, of the
  /// base frame.
  void write_odometry(const std::string& topic, HostTime t, const OdometrySample& sample);

  /// The first failure so far.
  [[nodiscard]] Result<void> status() const;
  /// Ends the bag: one file, and metadata.yaml. Later samples are ignored.
  [[nodiscard]] Result<void> close();

 private:
  class Implementation;
  explicit BagWriter(std::unique_ptr<Implementation> implementation);
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace geoflow::drivers
