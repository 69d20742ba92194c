#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"
#include "geoflow/tools/emulator/world.hpp"

namespace geoflow::emulator {

/// A world that gives what it was given. Images are 640 x 480; a pixel's value follows from its
/// place and the frame's number.
class ScriptedWorld final : public World {
 public:
  static constexpr int kWidth = 640;
  static constexpr int kHeight = 480;

  ScriptedWorld() {
    calibration_.camera = {
        .width = kWidth, .height = kHeight, .fx = 600.5, .fy = 601.25, .cx = 322.125, .cy = 238.75};
    calibration_.T_cam_imu = SE3{so3::exp({0.1, -0.2, 0.3}), Vector3d{0.01, -0.02, 0.03}};
  }

  [[nodiscard]] Calibration& edit_calibration() noexcept { return calibration_; }
  [[nodiscard]] const Calibration& calibration() const override { return calibration_; }
  [[nodiscard]] Result<std::optional<WorldSample>> next() override {
    if (samples_.empty()) {
      return std::nullopt;
    }
    WorldSample sample = std::move(samples_.front());
    samples_.pop_front();
    return sample;
  }

  void add(WorldSample sample) { samples_.push_back(std::move(sample)); }
  /// A colour and a depth image, sent 10 ms after the middle of their exposure.
  void add_images(std::uint8_t number, Duration t) {
    const Duration sent = t + Duration{10'000'000};
    add({.t = t, .t_sent = sent, .sample = ColorFrame{image(number, PixelFormat::kBgr8)}});
    add({.t = t, .t_sent = sent, .sample = DepthFrame{image(number, PixelFormat::kDepth16)}});
  }
  void add_imu(const ImuSample& sample, Duration t) {
    add({.t = t, .t_sent = t, .sample = sample});
  }

  [[nodiscard]] static std::uint8_t pattern(std::uint8_t number, std::size_t index) noexcept {
    constexpr std::size_t kLarge = 2654435761;
    return static_cast<std::uint8_t>(((index + 1) * kLarge >> 13U) + number);
  }

  /// The bytes of an image of `number` in a format of `bytes_per_pixel`.
  [[nodiscard]] static Bytes pixels(std::uint8_t number, std::size_t bytes_per_pixel) {
    Bytes bytes(bytes_per_pixel * kWidth * kHeight);
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<std::byte>(pattern(number, i));
    }
    return bytes;
  }

 private:
  [[nodiscard]] FrameRef image(std::uint8_t number, PixelFormat format) {
    FrameRef frame = pool_.acquire({kWidth, kHeight, format});
    std::ranges::copy(pixels(number, bytes_per_pixel(format)), frame.writable_bytes().begin());
    return frame;
  }

  Calibration calibration_;
  FramePool pool_{256};
  std::deque<WorldSample> samples_;
};

}  // namespace geoflow::emulator
