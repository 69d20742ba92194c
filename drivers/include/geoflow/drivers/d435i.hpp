#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "geoflow/drivers/live_camera.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"

/// The Intel RealSense D435i (docs/d435i.md).
namespace geoflow::drivers {

/// The way to the camera.
enum class D435iTransport : std::uint8_t {
  kAuto,    ///< the kernel's drivers if they are bound to it, else USB
  kV4l2,    ///< the kernel's: uvcvideo and the IIO sensors
  kLibusb,  ///< USB itself; the kernel's drivers are detached
};

struct D435iOptions {
  D435iTransport transport = D435iTransport::kAuto;
  std::string serial{};  ///< what USB shows as serial number; empty: the first camera found
  // NOLINTBEGIN(readability-magic-numbers): each default is named by its member
  int width = 640;   ///< of colour and depth [px]
  int height = 480;  ///< [px]
  int rate_hz = 30;
  int accel_hz = 200;  ///< 63 or 250 (BMI055), 100, 200 or 400 (BMI085)
  int gyro_hz = 200;   ///< 200 or 400
  // NOLINTEND(readability-magic-numbers)
  std::optional<bool> emitter{};        ///< the pattern projector; none: as the camera has it
  std::optional<int> exposure_us{};     ///< of depth; none: automatic
  std::optional<int> laser_power_mw{};  ///< of the projector, 0 to 360; none: as it is
  bool color_as_gray = false;           ///< kGray8 instead of kBgr8
};

/// How a camera is doing. Counters never decrease.
struct D435iStatus {
  bool streaming = false;
  std::string trouble{};    ///< a sentence; empty while all is well
  std::string transport{};  ///< "v4l2" or "libusb"; empty while the camera is away
  std::string place{};      ///< bus and ports: "2-1.4"
  bool super_speed = false;
  std::string firmware{};
  std::uint64_t depth_frames = 0;
  std::uint64_t color_frames = 0;
  std::uint64_t damaged_frames = 0;
  std::uint64_t missed_frames = 0;  ///< by the camera's own frame counters
  std::uint64_t imu_reports = 0;
  std::uint64_t imu_unpaired = 0;  ///< gyroscope values without an acceleration at their time
  std::uint64_t stamped_by_arrival = 0;
  std::uint64_t stalls = 0;  ///< times that a video stream fell silent
  std::uint64_t stream_restarts = 0;
  std::uint64_t camera_restarts = 0;
  std::uint64_t port_resets = 0;
  std::uint64_t hardware_resets = 0;
  std::uint64_t imu_restarts = 0;
  std::uint64_t losses = 0;  ///< times that the camera went away
  std::uint64_t opens = 0;
  /// Turns of run(): several a second, whether or not the camera is there, but while it is reset.
  std::uint64_t turns = 0;
};

/// A D435i behind the ports: colour, depth registered to it, and the IMU.
///
/// status() may be called from other threads, but not from inside a sink.
class D435i final : public LiveCamera {
 public:
  /// Finds the camera and reads its calibration. kNotFound where there is none, else an Error that
  /// says in words what is in the way. Waits for the firmware, a second at most.
  [[nodiscard]] static Result<std::unique_ptr<D435i>> open(const D435iOptions& options);

  D435i(const D435i&) = delete;
  D435i& operator=(const D435i&) = delete;
  ~D435i() override;

  [[nodiscard]] const Calibration& calibration() const override;
  [[nodiscard]] DepthCamera& camera() override;
  [[nodiscard]] Imu* imu() override;

  /// See docs/d435i.md, "Recovery".
  void run(const std::stop_token& stop) override;
  [[nodiscard]] std::uint64_t turns() const override;

  [[nodiscard]] D435iStatus status() const;

  class Implementation;  ///< for this part's own use
  explicit D435i(std::unique_ptr<Implementation> implementation);

 private:
  std::unique_ptr<Implementation> implementation_;
};

/// One thing that was looked at.
struct D435iFinding {
  enum class Grade : std::uint8_t {
    kGood,
    kNote,    ///< it works, but not as well as it could
    kProblem  ///< it does not work by this way
  };
  Grade grade = Grade::kGood;
  std::string what{};    ///< a sentence
  std::string remedy{};  ///< what to do about it; empty where nothing is to be done
};

/// Looks at everything that a D435i needs on this machine: link, permissions, kernel drivers,
/// metadata, IMU. Opens nothing for longer than it takes to ask; a running daemon is not disturbed.
[[nodiscard]] std::vector<D435iFinding> diagnose_d435i();

}  // namespace geoflow::drivers
