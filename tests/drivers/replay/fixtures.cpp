#include "replay/fixtures.hpp"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/core.h>
#include <gtest/gtest.h>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::drivers::tests {

void write_text(const std::filesystem::path& path, std::string_view content) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream{path, std::ios::binary} << content;
}

void write_color(const std::filesystem::path& path, int value, int width, int height) {
  std::filesystem::create_directories(path.parent_path());
  cv::imwrite(path.string(), cv::Mat(height, width, CV_8UC3, cv::Scalar::all(value)));
}

void write_depth(const std::filesystem::path& path, std::uint16_t value, int width, int height) {
  std::filesystem::create_directories(path.parent_path());
  cv::imwrite(path.string(), cv::Mat(height, width, CV_16UC1, cv::Scalar::all(value)));
}

void write_camchain(const std::filesystem::path& directory) {
  write_text(directory / "camchain.yaml",
             fmt::format("cam0:\n  camera_model: pinhole\n  intrinsics: [30, 30, 16, 12]\n  "
                         "distortion_model: none\n"
                         "  distortion_coeffs: []\n  resolution: [{}, {}]\ndepth_factor: 1000\n",
                         kWidth, kHeight));
}

void write_tum(const std::filesystem::path& directory, int count) {
  constexpr double kStart_s = 100;
  constexpr double kRate_hz = 30;
  constexpr double kDepthLag_s = 0.001;
  std::string rgb = "# color images\n# timestamp filename\n";
  std::string depth = "# depth maps\r\n";
  for (int i = 0; i < count; ++i) {
    const double t = kStart_s + i / kRate_hz;
    rgb += fmt::format("{:.6f} rgb/{}.png\n", t, i);
    depth += fmt::format("{:.6f} depth/{}.png\r\n", t + kDepthLag_s, i);
    write_color(directory / fmt::format("rgb/{}.png", i), i);
    write_depth(directory / fmt::format("depth/{}.png", i), static_cast<std::uint16_t>(i));
  }
  write_text(directory / "rgb.txt", rgb);
  write_text(directory / "depth.txt", depth);
  write_text(directory / "accelerometer.txt", "this is not read\n");
  write_camchain(directory);
}

void Recorder::on_color(const Arrival<CameraClock, ColorFrame>& frame) {
  order += 'c';
  arrivals.push_back(frame.t_arrival);
  colors.push_back(frame);
}
void Recorder::on_depth(const Arrival<CameraClock, DepthFrame>& frame) {
  order += 'd';
  arrivals.push_back(frame.t_arrival);
  depths.push_back(frame);
}
void Recorder::on_imu(const Arrival<ImuClock, ImuSample>& sample) {
  order += 'i';
  arrivals.push_back(sample.t_arrival);
  imus.push_back(sample);
}
void Recorder::on_legs(const Arrival<LegClock, LegSample>& sample) {
  order += 'l';
  arrivals.push_back(sample.t_arrival);
}
void Recorder::on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) {
  order += 'v';
  arrivals.push_back(sample.t_arrival);
}

std::vector<std::string> drain(RecordedStreams& streams) {
  std::vector<std::string> errors;
  for (auto more = streams.step(); !more || *more; more = streams.step()) {
    if (!more) {
      errors.push_back(more.error().message);
    }
  }
  return errors;
}

}  // namespace geoflow::drivers::tests
