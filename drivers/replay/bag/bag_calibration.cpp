#include "replay/bag/bag_calibration.hpp"

#include <optional>
#include <string>
#include <string_view>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/log.hpp"

#include "replay/bag/bag.hpp"
#include "replay/bag/extras.hpp"
#include "replay/bag/samples.hpp"
#include "replay/bag/topic_choice.hpp"
#include "replay/bag/transforms.hpp"
#include "replay/cdr/codec.hpp"
#include "replay/cdr/messages.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::bag {
namespace {

constexpr const char* kStaticTransforms = "/tf_static";
constexpr double kRosDepthUnitM = 1e-3;

/// realsense-ros has depth that librealsense aligned under this name.
DepthAlignment alignment_of(std::string_view depth_topic) {
  return depth_topic.find("aligned_depth_to_color") == std::string_view::npos
             ? DepthAlignment::kExact
             : DepthAlignment::kNearestTouching;
}

/// Collects what messages say until nothing more is wanted.
class Collector {
 public:
  explicit Collector(const TopicChoice& choice) : choice_{choice} {}

  [[nodiscard]] bool wants(std::string_view topic) const {
    return topic == kStaticTransforms ||
           (!topic.empty() && ((topic == choice_.camera_info && !camera_) ||
                               (topic == choice_.imu && imu_frame_.empty())));
  }

  void add(const BagMessage& message) {
    if (message.topic == kStaticTransforms) {
      add_transforms(message);
    } else if (message.topic == choice_.camera_info) {
      add_camera(message);
    } else if (imu_frame_.empty()) {
      if (const auto imu = cdr::decode<ros::Imu>(message.data)) {
        imu_frame_ = imu->header.frame_id;
      }
    }
  }

  [[nodiscard]] bool has_camera() const {
    return camera_.has_value() || choice_.camera_info.empty();
  }
  [[nodiscard]] const std::optional<CameraIntrinsics>& camera() const { return camera_; }
  [[nodiscard]] const StaticTransforms& transforms() const { return transforms_; }
  [[nodiscard]] std::string camera_frame() const {
    return camera_frame_.empty() ? "camera_color_optical_frame" : camera_frame_;
  }
  [[nodiscard]] std::string imu_frame() const {
    return imu_frame_.empty() ? "camera_imu_optical_frame" : imu_frame_;
  }

 private:
  void add_transforms(const BagMessage& message) {
    if (const auto tf = cdr::decode<ros::TfMessage>(message.data)) {
      for (const ros::TransformStamped& transform : tf->transforms) {
        transforms_.add(transform);
      }
    }
  }
  void add_camera(const BagMessage& message) {
    if (camera_) {
      return;
    }
    const auto info = cdr::decode<ros::CameraInfo>(message.data);
    if (!info) {
      return;
    }
    if (const auto camera = to_intrinsics(*info)) {
      camera_ = *camera;
      camera_frame_ = info->header.frame_id;
    } else if (!warned_) {
      warned_ = true;
      log::warning("recording", "{}: {}", message.origin, camera.error().message);
    }
  }

  const TopicChoice& choice_;
  StaticTransforms transforms_;
  std::optional<CameraIntrinsics> camera_;
  std::string camera_frame_;
  std::string imu_frame_;
  bool warned_ = false;
};

}  // namespace

FoundCalibration find_bag_calibration(Bag& bag, const TopicChoice& choice, const TopicNames& names,
                                      const Extras& extras) {
  Collector collector{choice};
  bag.scan([&](std::string_view topic) { return collector.wants(topic); },
           [&](const BagMessage& message) { collector.add(message); },
           [&] { return collector.has_camera(); });
  FoundCalibration found{
      .camera = collector.camera(),
      .depth_unit_m = extras.depth_unit_m.value_or(kRosDepthUnitM),
      .depth_alignment = extras.depth_alignment.value_or(alignment_of(choice.depth)),
      .T_cam_imu = std::nullopt,
      .timeshift_cam_imu = extras.timeshift_cam_imu,
      .imu_noise = extras.imu_noise,
      .T_base_cam = std::nullopt,
      .source = choice.camera_info};
  const StaticTransforms& transforms = collector.transforms();
  for (const std::string& base : {names.base_frame, std::string{"base"}}) {
    if (!found.T_base_cam) {
      found.T_base_cam = transforms.find(base, collector.camera_frame());
    }
  }
  if (!choice.imu.empty()) {
    found.T_cam_imu = transforms.find(collector.camera_frame(), collector.imu_frame());
  }
  if (found.T_base_cam || found.T_cam_imu) {
    found.source +=
        found.source.empty() ? kStaticTransforms : std::string{" and "} + kStaticTransforms;
  }
  return found;
}

}  // namespace geoflow::drivers::bag
