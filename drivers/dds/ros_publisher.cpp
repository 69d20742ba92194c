#include "geoflow/drivers/ros_publisher.hpp"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <RosMessages.h>
#include <dds/dds.h>
#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "dds/channel.hpp"
#include "dds/session.hpp"

namespace geoflow::drivers {
namespace dds {
namespace {

constexpr std::int32_t kHistory = 10;
constexpr std::int32_t kTransformHistory = 100;
constexpr dds_duration_t kLongestBlock =
    std::chrono::nanoseconds{std::chrono::milliseconds{100}}.count();

Qos make_qos(std::int32_t history) {
  Qos qos{::dds_create_qos()};
  ::dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, kLongestBlock);
  ::dds_qset_durability(qos.get(), DDS_DURABILITY_VOLATILE);
  ::dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, history);
  const dds_data_representation_id_t plain = DDS_DATA_REPRESENTATION_XCDR1;
  ::dds_qset_data_representation(qos.get(), 1, &plain);
  return qos;
}

// What is written are idlc's C structs. Their pointers are to what C++ owns, and DDS reads it only
// during the write.

builtin_interfaces_msg_dds__Time_ stamp(Duration t) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(t);
  return {.sec = static_cast<std::int32_t>(seconds.count()),
          .nanosec = static_cast<std::uint32_t>((t - seconds).count())};
}

template <typename Vector>
Vector vector(const Vector3d& v) {
  return {.x = v.x(), .y = v.y(), .z = v.z()};
}

geometry_msgs_msg_dds__Quaternion_ quaternion(const SE3& transform) {
  const Eigen::Quaterniond& q = transform.rotation();
  return {.x = q.x(), .y = q.y(), .z = q.z(), .w = q.w()};
}

// NOLINTNEXTLINE(modernize-avoid-c-arrays): a C struct's
void write_rows(double (&rows)[std::size_t{6} * 6], const Matrix6d& matrix) {
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>{&rows[0]} = matrix;
}

geometry_msgs_msg_dds__TransformStamped_ transform_stamped(const SE3& transform, Duration t,
                                                           std::string& frame, std::string& child) {
  using Vector3 = geometry_msgs_msg_dds__Vector3_;
  return {.header = {.stamp = stamp(t), .frame_id = frame.data()},
          .child_frame_id = child.data(),
          .transform = {.translation = vector<Vector3>(transform.translation()),
                        .rotation = quaternion(transform)}};
}

/// One topic's writer.
class Topic {
 public:
  static Result<Topic> open(const Session& session, Address address,
                            const dds_topic_descriptor_t& type, std::int32_t history) {
    const auto topic = open_topic(session, address, type);
    if (!topic) {
      return tl::unexpected{topic.error()};
    }
    const dds_entity_t writer =
        ::dds_create_writer(session.participant.get(), *topic, make_qos(history).get(), nullptr);
    if (writer < 0) {
      return refused(address, "cannot be written", writer);
    }
    return Topic{std::move(address), writer};
  }

  [[nodiscard]] Result<void> write(const void* message) const {
    const dds_return_t written = ::dds_write(writer_, message);
    // A reader that does not keep up: it misses this one.
    return written == DDS_RETCODE_OK || written == DDS_RETCODE_TIMEOUT
               ? Result<void>{}
               : Result<void>{refused(address_, "cannot be written", written)};
  }
  [[nodiscard]] std::uint32_t readers() const {
    dds_publication_matched_status_t status{};
    return ::dds_get_publication_matched_status(writer_, &status) == DDS_RETCODE_OK
               ? status.current_count
               : 0;
  }

 private:
  Topic(Address address, dds_entity_t writer) : address_{std::move(address)}, writer_{writer} {}
  Address address_;
  dds_entity_t writer_;  // the session's
};

struct Topics {
  Topic odom;
  Topic tf;
  Topic diagnostics;
};

class CycloneRosPublisher final : public RosPublisher {
 public:
  CycloneRosPublisher(RosPublisherOptions options, Session session, Topics topics)
      : options_{std::move(options)}, session_{std::move(session)}, topics_{std::move(topics)} {}

  Result<void> write(const RosPose& pose) override {
    using Point = geometry_msgs_msg_dds__Point_;
    using Vector3 = geometry_msgs_msg_dds__Vector3_;
    nav_msgs_msg_dds__Odometry_ odometry{
        .header = {.stamp = stamp(pose.t), .frame_id = options_.odom_frame.data()},
        .child_frame_id = options_.base_frame.data(),
        .pose = {.pose = {.position = vector<Point>(pose.T_odom_base.translation()),
                          .orientation = quaternion(pose.T_odom_base)},
                 .covariance = {}},
        .twist = {.twist = {.linear = vector<Vector3>(pose.v_base),
                            .angular = vector<Vector3>(pose.w_base)},
                  .covariance = {}}};
    write_rows(odometry.pose.covariance, pose.pose_covariance);
    write_rows(odometry.twist.covariance, pose.twist_covariance);
    return topics_.odom.write(&odometry).and_then([&] { return write_transforms(pose); });
  }

  Result<void> write(std::span<const RosDiagnostic> diagnostics, Duration t) override {
    std::vector<RosDiagnostic> own{diagnostics.begin(), diagnostics.end()};
    std::vector<std::vector<diagnostic_msgs_msg_dds__KeyValue_>> values;
    std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> list;
    std::string hardware = options_.name.empty() ? "geoflow" : options_.name;
    for (RosDiagnostic& diagnostic : own) {
      auto& pairs = values.emplace_back();
      for (auto& [key, value] : diagnostic.values) {
        pairs.push_back({.key = key.data(), .value = value.data()});
      }
      list.push_back({.level = static_cast<std::uint8_t>(diagnostic.level),
                      .name = diagnostic.name.data(),
                      .message = diagnostic.message.data(),
                      .hardware_id = hardware.data(),
                      .values = {._maximum = static_cast<std::uint32_t>(pairs.size()),
                                 ._length = static_cast<std::uint32_t>(pairs.size()),
                                 ._buffer = pairs.data(),
                                 ._release = false}});
    }
    std::string no_frame;
    const diagnostic_msgs_msg_dds__DiagnosticArray_ array{
        .header = {.stamp = stamp(t), .frame_id = no_frame.data()},
        .status = {._maximum = static_cast<std::uint32_t>(list.size()),
                   ._length = static_cast<std::uint32_t>(list.size()),
                   ._buffer = list.data(),
                   ._release = false}};
    return topics_.diagnostics.write(&array);
  }

  [[nodiscard]] std::uint32_t readers() const override { return topics_.odom.readers(); }

 private:
  Result<void> write_transforms(const RosPose& pose) {
    std::array transforms = {
        transform_stamped(pose.T_map_odom, pose.t, options_.map_frame, options_.odom_frame),
        transform_stamped(pose.T_odom_base, pose.t, options_.odom_frame, options_.base_frame)};
    const auto count = static_cast<std::uint32_t>(transforms.size());
    const tf2_msgs_msg_dds__TFMessage_ message{
        .transforms = {
            ._maximum = count, ._length = count, ._buffer = transforms.data(), ._release = false}};
    return topics_.tf.write(&message);
  }

  RosPublisherOptions options_;
  Session session_;
  Topics topics_;
};

}  // namespace
}  // namespace dds

Result<std::unique_ptr<RosPublisher>> RosPublisher::open(const RosPublisherOptions& options) {
  const auto address = [&](std::string_view topic) {
    // ROS 2's topics begin with rt in DDS.
    return dds::Address{
        .topic = (options.name.empty() ? "rt/" : "rt/" + options.name + "/") + std::string{topic},
        .domain = static_cast<std::uint32_t>(options.domain),
        .interface = options.interface};
  };
  auto session = dds::join(address("odom"));
  if (!session) {
    return tl::unexpected{std::move(session.error())};
  }
  auto odom =
      dds::Topic::open(*session, address("odom"), nav_msgs_msg_dds__Odometry__desc, dds::kHistory);
  auto tf = dds::Topic::open(*session, address("tf"), tf2_msgs_msg_dds__TFMessage__desc,
                             dds::kTransformHistory);
  auto diagnostics =
      dds::Topic::open(*session, address("diagnostics"),
                       diagnostic_msgs_msg_dds__DiagnosticArray__desc, dds::kHistory);
  for (const auto* topic : {&odom, &tf, &diagnostics}) {
    if (!*topic) {
      return tl::unexpected{topic->error()};
    }
  }
  return std::make_unique<dds::CycloneRosPublisher>(
      options, *std::move(session),
      dds::Topics{
          .odom = *std::move(odom), .tf = *std::move(tf), .diagnostics = *std::move(diagnostics)});
}

}  // namespace geoflow::drivers
