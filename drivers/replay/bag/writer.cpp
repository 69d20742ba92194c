#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/drivers/bag_writer.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/bag/extras.hpp"
#include "replay/bag/samples.hpp"
#include "replay/bag/storage.hpp"
#include "replay/cdr/codec.hpp"
#include "replay/cdr/messages.hpp"

namespace geoflow::drivers {
namespace {

using bag::Extras;
using bag::Storage;
using bag::to_message;

Extras extras_of(const BagWriterOptions& options, const Calibration& calibration) {
  return {
      .depth_unit_m = calibration.depth_unit_m,
      .depth_alignment = calibration.depth_alignment,
      .timeshift_cam_imu = calibration.timeshift_cam_imu,
      .imu_noise = calibration.imu_noise,
      .stamps = {
          .camera = options.camera_stamps, .imu = options.imu_stamps, .legs = options.leg_stamps}};
}

constexpr bool kLatched = true;

/// `/camera/color/image_raw` -> `/camera/color/camera_info`.
std::string info_topic(const std::string& image_topic) {
  return image_topic.substr(0, image_topic.rfind('/')) + "/camera_info";
}

}  // namespace

class BagWriter::Implementation {
 public:
  Implementation(BagWriterOptions options, const Calibration& calibration,
                 std::unique_ptr<Storage> storage)
      : options_{std::move(options)}, calibration_{calibration}, storage_{std::move(storage)} {}

  /// Writes `message`, stamped, under `topic`.
  template <typename Clock, typename Message>
  void write(const std::string& topic, DeviceTime<Clock> t_device, HostTime t_arrival,
             Message message) {
    const std::scoped_lock lock{mutex_};
    write_transforms(t_arrival);
    put(topic, t_device.time_since_epoch(), t_arrival, std::move(message));
  }

  void write_image(const std::string& topic, DeviceTime<CameraClock> t_device, HostTime t_arrival,
                   const FrameRef& frame) {
    ros::Image image = to_message(frame);
    image.header.frame_id = options_.camera_frame;
    const std::scoped_lock lock{mutex_};
    write_transforms(t_arrival);
    put(topic, t_device.time_since_epoch(), t_arrival, std::move(image));
    if (calibration_.camera.width > 0) {
      ros::CameraInfo info = to_message(calibration_.camera);
      info.header.frame_id = options_.camera_frame;
      put(info_topic(topic), t_device.time_since_epoch(), t_arrival, std::move(info));
    }
  }

  [[nodiscard]] Result<void> status() const {
    const std::scoped_lock lock{mutex_};
    return status_;
  }

  [[nodiscard]] Result<void> close() {
    const std::scoped_lock lock{mutex_};
    if (storage_) {
      auto closed = storage_->close();
      storage_.reset();
      status_ = status_.and_then([&closed] { return closed; });
    }
    return status_;
  }

  [[nodiscard]] const BagWriterOptions& options() const noexcept { return options_; }

 private:
  template <typename Message>
  void put(const std::string& topic, Duration stamp, HostTime t_arrival, Message message) {
    if (!status_ || !storage_ || topic.empty()) {
      return;
    }
    auto ros_stamp = bag::to_stamp(stamp);
    if (!ros_stamp) {
      status_ = tl::unexpected{std::move(ros_stamp).error().in(topic)};
      return;
    }
    message.header.stamp = *ros_stamp;
    status_ = storage_->write(topic, Message::kType, t_arrival.time_since_epoch().count(),
                              cdr::encode(message), !kLatched);
  }

  /// /tf_static, before the first sample.
  void write_transforms(HostTime t_arrival) {
    if (std::exchange(has_transforms_, true) || !storage_) {
      return;
    }
    ros::TfMessage tf;
    add_transform(tf, options_.topics.base_frame, options_.camera_frame, calibration_.T_base_cam);
    add_transform(tf, options_.camera_frame, options_.imu_frame, calibration_.T_cam_imu);
    if (!tf.transforms.empty()) {
      status_ = storage_->write("/tf_static", ros::TfMessage::kType,
                                t_arrival.time_since_epoch().count(), cdr::encode(tf), kLatched);
    }
  }

  static void add_transform(ros::TfMessage& tf, const std::string& parent, const std::string& child,
                            const std::optional<SE3>& T_parent_child) {
    if (T_parent_child) {
      ros::TransformStamped& transform = tf.transforms.emplace_back();
      transform.header.frame_id = parent;
      transform.child_frame_id = child;
      transform.transform = bag::to_transform(*T_parent_child);
    }
  }

  const BagWriterOptions options_;
  const Calibration calibration_;
  mutable std::mutex mutex_;
  std::unique_ptr<Storage> storage_;
  Result<void> status_{};
  bool has_transforms_ = false;
};

Result<std::unique_ptr<BagWriter>> BagWriter::create(const BagWriterOptions& options,
                                                     const Calibration& calibration) {
  auto storage = Storage::create(
      {.directory = options.directory,
       .storage = options.storage,
       .compression_level =
           options.compress ? std::optional{options.compression_level} : std::nullopt,
       .commit_after = options.commit_after,
       .commit_after_bytes = options.commit_after_bytes,
       .custom_data = to_custom_data(extras_of(options, calibration))});
  if (!storage) {
    return tl::unexpected{std::move(storage).error()};
  }
  return std::unique_ptr<BagWriter>{
      new BagWriter{std::make_unique<Implementation>(options, calibration, std::move(*storage))}};
}

BagWriter::BagWriter(std::unique_ptr<Implementation> implementation)
    : implementation_{std::move(implementation)} {}

BagWriter::~BagWriter() {
  if (const auto closed = implementation_->close(); !closed) {
    log::error("recording", "{}", closed.error().message);
  }
}

void BagWriter::on_color(const Arrival<CameraClock, ColorFrame>& frame) {
  implementation_->write_image(implementation_->options().topics.color, frame.t_device,
                               frame.t_arrival, frame.sample.image);
}

void BagWriter::on_depth(const Arrival<CameraClock, DepthFrame>& frame) {
  implementation_->write_image(implementation_->options().topics.depth, frame.t_device,
                               frame.t_arrival, frame.sample.image);
}

void BagWriter::on_imu(const Arrival<ImuClock, ImuSample>& sample) {
  ros::Imu message = to_message(sample.sample);
  message.header.frame_id = implementation_->options().imu_frame;
  implementation_->write(implementation_->options().topics.imu, sample.t_device, sample.t_arrival,
                         std::move(message));
}

void BagWriter::on_legs(const Arrival<LegClock, LegSample>& sample) {
  implementation_->write(implementation_->options().topics.legs, sample.t_device, sample.t_arrival,
                         to_message(sample.sample));
}

void BagWriter::on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) {
  const BagWriterOptions& options = implementation_->options();
  ros::Odometry message = to_message(sample.sample);
  message.header.frame_id = options.odom_frame;
  message.child_frame_id = options.topics.base_frame;
  implementation_->write(options.topics.odometry, sample.t_device, sample.t_arrival,
                         std::move(message));
}

void BagWriter::write_odometry(const std::string& topic, HostTime t, const OdometrySample& sample) {
  const BagWriterOptions& options = implementation_->options();
  ros::Odometry message = to_message(
      BodyVelocitySample{.v_base_mps = sample.v_child_mps, .w_base_radps = sample.w_child_radps});
  message.header.frame_id = options.odom_frame;
  message.child_frame_id = options.topics.base_frame;
  const ros::Transform transform = bag::to_transform(sample.T_parent_child);
  message.pose.pose = {.position = transform.translation, .orientation = transform.rotation};
  implementation_->write(topic, DeviceTime<LegClock>{t.time_since_epoch()}, t, std::move(message));
}

Result<void> BagWriter::status() const {
  return implementation_->status();
}

Result<void> BagWriter::close() {
  return implementation_->close();
}

}  // namespace geoflow::drivers
