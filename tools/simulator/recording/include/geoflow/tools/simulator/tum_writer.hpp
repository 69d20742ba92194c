#pragma once

#include <filesystem>
#include <fstream>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

namespace geoflow::simulator {

/// Writes images and inertial samples as files, in the form of the TUM RGB-D benchmark: rgb/ and
/// depth/ (16-bit PNG in millimetres), rgb.txt and depth.txt, the calibration as Kalibr's
/// files, and imu.csv in EuRoC's form. Stamps are the samples' own. The first failure is kept:
/// from then on samples are ignored. Thread-bound.
class TumWriter final : public CameraSink, public ImuSink {
 public:
  explicit TumWriter(std::filesystem::path directory);

  /// Makes the folders and writes the calibration.
  [[nodiscard]] Result<void> open(const Calibration& calibration);
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override;
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override;
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override;
  /// Ends the lists; the first failure.
  [[nodiscard]] Result<void> close();

 private:
  void write(const std::string& folder, std::ofstream& list, Duration stamp, const FrameRef& image);

  std::filesystem::path directory_;
  std::ofstream color_;
  std::ofstream depth_;
  std::ofstream imu_;
  Result<void> status_{};
};

}  // namespace geoflow::simulator
