#include "synthetic_recording.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace geoflow::tests {
namespace {

constexpr double kDepthCountsPerMetre = 5000;

/// A wall with corners everywhere, wide enough for the whole slide.
cv::Mat make_texture(const SyntheticRecording& recording) {
  const int width = recording.width + recording.frames * recording.shift_px;
  cv::Mat texture(recording.height, width, CV_8UC1);
  cv::RNG random{42};
  random.fill(texture, cv::RNG::UNIFORM, 40, 215);
  cv::GaussianBlur(texture, texture, {5, 5}, 1.2);
  for (int i = 0; i < width * recording.height / 400; ++i) {
    const cv::Point corner{random.uniform(0, width), random.uniform(0, recording.height)};
    const cv::Size size{random.uniform(4, 18), random.uniform(4, 18)};
    cv::rectangle(texture, cv::Rect{corner, size}, cv::Scalar(random.uniform(0, 255)), cv::FILLED);
  }
  return texture;
}

void write_calibration(const std::filesystem::path& directory,
                       const SyntheticRecording& recording) {
  std::ofstream{directory / "camchain.yaml"} << fmt::format(
      "cam0:\n  camera_model: pinhole\n  intrinsics: [{0}, {0}, {1}, {2}]\n  distortion_model: "
      "none\n"
      "  distortion_coeffs: []\n  resolution: [{3}, {4}]\ndepth_factor: {5}\n",
      recording.focal_px, recording.width / 2, recording.height / 2, recording.width,
      recording.height, kDepthCountsPerMetre);
}

}  // namespace

void write_synthetic_recording(const std::filesystem::path& directory,
                               const SyntheticRecording& recording) {
  std::filesystem::create_directories(directory / "rgb");
  std::filesystem::create_directories(directory / "depth");
  const cv::Mat texture = make_texture(recording);
  const cv::Mat depth(recording.height, recording.width, CV_16UC1,
                      cv::Scalar(std::round(recording.wall_m * kDepthCountsPerMetre)));
  std::ofstream rgb_list{directory / "rgb.txt"};
  std::ofstream depth_list{directory / "depth.txt"};
  for (int i = 0; i < recording.frames; ++i) {
    const std::string name = fmt::format("{:04}.png", i);
    const cv::Rect view{i * recording.shift_px, 0, recording.width, recording.height};
    if (!cv::imwrite((directory / "rgb" / name).string(), texture(view)) ||
        !cv::imwrite((directory / "depth" / name).string(), depth)) {
      throw std::runtime_error{"cannot write " + name};
    }
    const double stamp = 1000.0 + i / recording.rate_hz;
    rgb_list << fmt::format("{:.6f} rgb/{}\n", stamp, name);
    depth_list << fmt::format("{:.6f} depth/{}\n", stamp, name);
  }
  write_calibration(directory, recording);
}

}  // namespace geoflow::tests
