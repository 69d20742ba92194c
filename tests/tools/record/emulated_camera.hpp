#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <stop_token>

#include "geoflow/daemon/started_ports.hpp"
#include "geoflow/drivers/live_camera.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

namespace geoflow::tools::tests {

/// The D435i driver on an emulated camera in this process, which shows `recording` once while its
/// IMU feels no motion. Its time runs as it is polled: as fast as its samples are worked on.
[[nodiscard]] Result<std::unique_ptr<drivers::LiveCamera>> open_emulated_camera(
    const std::filesystem::path& recording);

/// A camera whose samples go to `second` as well, which gets each of them last.
class ForkedCamera final : public drivers::LiveCamera {
 public:
  ForkedCamera(std::unique_ptr<drivers::LiveCamera> camera, daemon::SampleReceiver& second);

  [[nodiscard]] const Calibration& calibration() const override;
  [[nodiscard]] DepthCamera& camera() override;
  [[nodiscard]] Imu* imu() override;
  void run(const std::stop_token& stop) override;
  [[nodiscard]] std::uint64_t turns() const override;

 private:
  class CameraFork;
  class ImuFork;
  std::unique_ptr<drivers::LiveCamera> inner_;
  std::shared_ptr<CameraFork> camera_;
  std::shared_ptr<ImuFork> imu_;
};

}  // namespace geoflow::tools::tests
