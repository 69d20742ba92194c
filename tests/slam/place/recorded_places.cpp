#include "recorded_places.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/trajectory_file.hpp"

#include "cloud/cell_grid.hpp"
#include "odometry/frame.hpp"
#include "odometry/tracker.hpp"
#include "vision/place_view.hpp"

namespace geoflow::slam::tests {
namespace {

/// A frame with memory of its own, row by row written by `fill(row of the copy, row of the frame,
/// width)`.
template <typename Pixel, typename Fill>
FrameRef copied(const FrameRef& frame, const Fill& fill) {
  FrameRef copy = FramePool{1}.acquire(frame.shape());
  const std::span<std::byte> bytes = copy.writable_bytes();
  for (int y = 0; y < frame.shape().height; ++y) {
    void* row = bytes.data() + static_cast<std::size_t>(y) * frame.shape().row_bytes();
    fill(static_cast<Pixel*>(row), frame.row<Pixel>(y), frame.shape().width);
  }
  return copy;
}

template <typename Pixel>
FrameRef mirrored(const FrameRef& frame) {
  return copied<Pixel>(frame, [](Pixel* to, const Pixel* from, int width) {
    std::reverse_copy(from, from + width, to);
  });
}

/// Keeps all images of a recording: more than its own buffers hold.
struct Images : CameraSink {
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    color.push_back(copied<std::uint8_t>(frame.sample.image, kCopy));
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    depth.push_back(copied<std::uint16_t>(frame.sample.image, kCopy));
  }
  static constexpr auto kCopy = [](auto* to, const auto* from, int width) {
    std::copy(from, from + width, to);
  };
  std::vector<FrameRef> color;
  std::vector<FrameRef> depth;
};

}  // namespace

RecordedPlaces::RecordedPlaces(const std::filesystem::path& path, std::size_t count) {
  const auto reference = tools::read_trajectory(path / "groundtruth.txt");
  EXPECT_TRUE(reference);
  reference_ = reference.value().poses;
  auto recording = drivers::RecordedStreams::open({.path = path, .color_as_gray = true});
  EXPECT_TRUE(recording) << recording.error().message;
  Images images;
  EXPECT_TRUE((*recording)->camera().start(images));
  while ((images.depth.size() < count || images.color.size() < count) &&
         (*recording)->step().value_or(false)) {
  }
  EXPECT_GE(std::min(images.depth.size(), images.color.size()), count);
  color_ = std::move(images.color);
  depth_ = std::move(images.depth);
  calibration_ = (*recording)->calibration();
  tracker_ = std::make_unique<Tracker>(
      config_, gicp_, calibration_,
      CellGrid::create(calibration_.camera, DepthCloudConfig{}.cell_px).value(), nullptr);
}

Frame RecordedPlaces::look(const FrameRef& color, const FrameRef& depth) {
  SyncedPacket packet;
  packet.color = color;
  packet.depth = depth;
  tracker_->begin_frame(packet);
  Frame frame = tracker_->current();
  frame.place =
      describe_place(frame.pyramid->image(), frame.depth, frame.cloud.get(), camera(), orb_);
  return frame;
}

SyncedPacket RecordedPlaces::packet(std::size_t i, const FrameRef& color, const FrameRef& depth) {
  constexpr auto kPeriod = std::chrono::nanoseconds{std::chrono::seconds{1}} / 30;
  SyncedPacket packet;
  packet.t = HostTime{kPeriod * static_cast<std::int64_t>(i + 1)};
  packet.sequence = i;
  packet.color = color;
  packet.depth = depth;
  return packet;
}

SyncedPacket RecordedPlaces::packet_mirrored(std::size_t i) const {
  return packet(i, mirrored<std::uint8_t>(color_[i]), mirrored<std::uint16_t>(depth_[i]));
}

Frame RecordedPlaces::look_mirrored(std::size_t i) {
  return look(mirrored<std::uint8_t>(color_[i]), mirrored<std::uint16_t>(depth_[i]));
}

}  // namespace geoflow::slam::tests
