#include "place/relocaliser.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/tools/trajectory_file.hpp"
#include "tests/support/data.hpp"

#include "map/map_builder.hpp"
#include "odometry/tracker.hpp"

/// Places of kitchen-400 (7-Scenes RedKitchen), and their mirror images as places that the map does
/// not have: they look just like a kitchen, but no rigid motion makes one of the other.
namespace geoflow::slam {
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

/// All images of a recording: more than its own buffers hold.
struct Images : CameraSink {
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    color.push_back(copied<std::uint8_t>(frame.sample.image, copy));
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    depth.push_back(copied<std::uint16_t>(frame.sample.image, copy));
  }
  static constexpr auto copy = [](auto* to, const auto* from, int width) {
    std::copy(from, from + width, to);
  };
  std::vector<FrameRef> color;
  std::vector<FrameRef> depth;
};

template <typename Pixel>
FrameRef mirrored(const FrameRef& frame) {
  return copied<Pixel>(frame, [](Pixel* to, const Pixel* from, int width) {
    std::reverse_copy(from, from + width, to);
  });
}

/// The packet of one instant.
SyncedPacket packet(const FrameRef& color, const FrameRef& depth) {
  SyncedPacket packet;
  packet.color = color;
  packet.depth = depth;
  return packet;
}

class RelocaliserOnKitchen : public testing::Test {
 protected:
  void SetUp() override {
    GEOFLOW_DATA_OR_SKIP(path, "kitchen-400");
    reference_ = tools::read_trajectory(path / "groundtruth.txt").value().poses;
    auto recording = drivers::RecordedStreams::open({.path = path, .color_as_gray = true});
    ASSERT_TRUE(recording) << recording.error().message;
    ASSERT_TRUE((*recording)->camera().start(images_));
    while (images_.depth.size() <= kLast || images_.color.size() <= kLast) {
      ASSERT_TRUE((*recording)->step().value_or(false));
    }
    calibration_ = (*recording)->calibration();
    grid_ = CellGrid::create(calibration_.camera, DepthCloudConfig{}.cell_px).value();
    tracker_ = std::make_unique<Tracker>(config_, gicp_, calibration_, grid_, nullptr);
    MapBuilder builder{config_, gicp_, calibration_, nullptr};
    for (std::size_t i = 0; i < kMapped; i += kKeyframeStep) {
      Frame& frame = look(packet(images_.color[i], images_.depth[i]));
      frame.T_odom_cam = reference_[i].pose;
      builder.insert(map_, frame, Matrix6d::Zero());
    }
  }

  Frame& look(const SyncedPacket& packet) {
    tracker_->begin_frame(packet);
    return tracker_->current();
  }

  std::optional<Relocation> find(const SyncedPacket& packet) {
    Frame& frame = look(packet);
    frame.place = describe_place(frame.pyramid->image(), frame.depth, calibration_.depth_unit_m,
                                 camera(), orb_);
    const Relocaliser relocaliser{config_, gicp_, camera()};
    return relocaliser.find(map_, frame, SE3{});
  }

  [[nodiscard]] CameraModel camera() const { return CameraModel{calibration_.camera}; }

  static constexpr std::size_t kLast = 150;
  static constexpr std::size_t kMapped = 100;
  static constexpr std::size_t kKeyframeStep = 10;

  Config config_;
  GicpConfig gicp_;
  Calibration calibration_;
  std::shared_ptr<const CellGrid> grid_;
  std::unique_ptr<Tracker> tracker_;
  OrbExtractor orb_{config_.features};
  Map map_;
  Images images_;
  std::vector<StampedPose> reference_;
};

TEST_F(RelocaliserOnKitchen, FindsFramesBetweenKeyframesWithoutAGuess) {
  for (std::size_t i = 5; i < kMapped; i += kKeyframeStep) {
    const auto found = find(packet(images_.color[i], images_.depth[i]));
    ASSERT_TRUE(found) << "frame " << i;
    const Vector6d error = (reference_[i].pose.inverse() * found->T_odom_cam).log();
    // What this recording's calibration and reference leave of a pose from one image.
    EXPECT_LT(error.tail<3>().norm(), 0.06) << "frame " << i;
    EXPECT_LT(error.head<3>().norm(), 0.03) << "frame " << i;
  }
}

TEST_F(RelocaliserOnKitchen, FindsNoMirrorImageAnywhere) {
  for (std::size_t i = 0; i <= kLast; i += 3) {
    EXPECT_FALSE(find(packet(mirrored<std::uint8_t>(images_.color[i]),
                             mirrored<std::uint16_t>(images_.depth[i]))))
        << "frame " << i;
  }
}

TEST_F(RelocaliserOnKitchen, IsNeverFarOffAfterTheMapEnds) {
  for (std::size_t i = kMapped; i <= kLast; i += 5) {
    const auto found = find(packet(images_.color[i], images_.depth[i]));
    if (found) {
      const Vector6d error = (reference_[i].pose.inverse() * found->T_odom_cam).log();
      EXPECT_LT(error.tail<3>().norm(), 0.15) << "frame " << i;
    }
  }
}

}  // namespace
}  // namespace geoflow::slam
