#include "bench/depth_sequence.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

constexpr Duration kTimeTolerance = std::chrono::milliseconds{10};

/// The pose nearest in time to `t`, if it is near enough.
const StampedPose* pose_at(const Trajectory& poses, HostTime t) {
  const auto distance = [&](const StampedPose& pose) {
    return pose.t < t ? t - pose.t : pose.t - t;
  };
  const auto nearest = std::ranges::min_element(
      poses, [&](const StampedPose& a, const StampedPose& b) { return distance(a) < distance(b); });
  return nearest != poses.end() && distance(*nearest) <= kTimeTolerance ? &*nearest : nullptr;
}

/// Copies of the depth images that have a pose: the recording's own buffers are few.
class Collector : public CameraSink {
 public:
  Collector(const Trajectory& poses, std::size_t count, DepthSequence& sequence)
      : poses_{poses}, pool_{count}, count_{count}, sequence_{sequence} {}

  void on_color(const Arrival<CameraClock, ColorFrame>& /*frame*/) override {}
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    const StampedPose* const pose = pose_at(poses_, HostTime{frame.t_device.time_since_epoch()});
    if (pose == nullptr || full()) {
      return;
    }
    FrameRef copy = pool_.acquire(frame.sample.image.shape());
    const auto bytes = frame.sample.image.bytes();
    std::memcpy(copy.writable_bytes().data(), bytes.data(), bytes.size());
    sequence_.depth.push_back(std::move(copy));
    sequence_.T_world_cam.push_back(pose->pose);
  }
  [[nodiscard]] bool full() const { return sequence_.depth.size() >= count_; }

 private:
  const Trajectory& poses_;
  FramePool pool_;
  std::size_t count_;
  DepthSequence& sequence_;
};

}  // namespace

Result<DepthSequence> read_depth_sequence(const std::filesystem::path& recording,
                                          const std::optional<std::filesystem::path>& reference,
                                          std::size_t count) {
  const auto poses = read_trajectory(reference.value_or(recording / "groundtruth.txt"));
  if (!poses) {
    return tl::unexpected{poses.error()};
  }
  auto streams = drivers::RecordedStreams::open({.path = recording, .color_as_gray = true});
  if (!streams) {
    return tl::unexpected{streams.error()};
  }
  DepthSequence sequence;
  sequence.calibration = (*streams)->calibration();
  Collector collector{poses->poses, count, sequence};
  if (auto started = (*streams)->camera().start(collector); !started) {
    return tl::unexpected{started.error()};
  }
  while (!collector.full()) {
    const auto more = (*streams)->step();
    if (!more) {
      return tl::unexpected{more.error()};
    }
    if (!*more) {
      break;
    }
  }
  (*streams)->camera().stop();
  return sequence;
}

}  // namespace geoflow::tools
