#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"

/// What every recording format is turned into: one sequence of events in order of arrival.
namespace geoflow::drivers {

enum class ImageStream : std::uint8_t { kColor, kDepth };

enum class ImageEncoding : std::uint8_t {
  kCompressed,  ///< the content of a PNG or JPEG file; which one, its first bytes say
  kRaw,         ///< rows of pixels
};

/// How the bytes of a kRaw image are to be understood.
struct RawLayout {
  ImageShape shape{};          ///< kDepth16, kGray8, kBgr8 or kRgb8
  std::size_t step_bytes = 0;  ///< from row to row, >= shape.row_bytes()
  bool big_endian = false;     ///< of the samples of kDepth16
  bool metres_f32 =
      false;  ///< depth as 32-bit floats in metres instead (ROS 32FC1); shape is kDepth16
};

/// An image as it stands in the recording.
struct EncodedImage {
  ImageStream stream = ImageStream::kColor;
  ImageEncoding encoding = ImageEncoding::kCompressed;
  RawLayout raw{};                 ///< only of a kRaw image
  std::vector<std::byte> bytes{};  ///< not yet checked against anything
  std::string origin{};            ///< where it stands, for errors: `rgb.txt:12: rgb/0001.png`
};

/// One sample in order of arrival. Its t_arrival is on the recording's time line.
using Event = std::variant<Arrival<CameraClock, EncodedImage>, Arrival<ImuClock, ImuSample>,
                           Arrival<LegClock, LegSample>, Arrival<LegClock, BodyVelocitySample>>;

/// The part of a calibration that a recording itself carries (camera_info, tf, sensors.yaml).
struct FoundCalibration {
  std::optional<CameraIntrinsics> camera{};
  std::optional<double> depth_unit_m{};
  std::optional<DepthAlignment> depth_alignment{};
  std::optional<SE3> T_cam_imu{};
  std::optional<Duration> timeshift_cam_imu{};
  std::optional<ImuNoise> imu_noise{};
  std::optional<SE3> T_base_cam{};
  std::string source;  ///< file or topics, for people
};

/// How each clock of a recording is stamped; legs is also the body velocity's.
struct RecordingStamps {
  StampInfo camera{};
  StampInfo imu{};
  StampInfo legs{};
};

/// One recording, read once from front to back without loading all of it. Thread-bound.
class RecordingReader {
 public:
  RecordingReader() = default;
  RecordingReader(const RecordingReader&) = delete;
  RecordingReader& operator=(const RecordingReader&) = delete;
  virtual ~RecordingReader() = default;

  /// Known from open() on.
  [[nodiscard]] virtual const RecordingInfo& info() const = 0;
  [[nodiscard]] virtual FoundCalibration calibration() const { return {}; }
  [[nodiscard]] virtual RecordingStamps stamps() const { return {}; }

  /// Poses of the colour camera that the recording holds as its own truth; empty where it has none.
  [[nodiscard]] virtual Trajectory reference() const { return {}; }

  /// The faults of the events returned so far; null where no fault script is at work.
  [[nodiscard]] virtual const FaultCounters* faults() const { return nullptr; }

  /// The next event; none at the end. An Error concerns one sample, names file and line or message
  /// number, and the next call goes on behind it; a reader that cannot go on returns its Error once
  /// and is at its end from then on.
  [[nodiscard]] virtual Result<std::optional<Event>> next() = 0;

  /// False once an Error ended the recording before its end.
  [[nodiscard]] virtual bool complete() const { return true; }
};

/// The stream of an event. Pure.
[[nodiscard]] StreamId stream_of(const Event& event) noexcept;

/// The arrival time of an event. Pure.
[[nodiscard]] HostTime arrival_of(const Event& event);

}  // namespace geoflow::drivers
