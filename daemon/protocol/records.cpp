#include "geoflow/daemon/records.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/propagated_pose.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::daemon {
namespace {

tl::unexpected<Refusal> refuse(geoflow_refusal reason, std::string text) {
  return tl::unexpected{Refusal{.reason = reason, .text = std::move(text)}};
}

std::string printable(std::string_view text) {
  std::string out{text.substr(0, text.find('\0'))};
  std::ranges::replace_if(out, [](char c) { return c < ' ' || c > '~'; }, '?');
  return out;
}

std::uint32_t sensors_of(const SyncedPacket& packet) {
  std::uint32_t sensors = 0;
  sensors |= packet.color ? std::uint32_t{GEOFLOW_SENSOR_COLOR} : 0U;
  sensors |= packet.depth ? std::uint32_t{GEOFLOW_SENSOR_DEPTH} : 0U;
  sensors |= packet.imu.empty() ? 0U : std::uint32_t{GEOFLOW_SENSOR_IMU};
  sensors |= packet.legs.empty() ? 0U : std::uint32_t{GEOFLOW_SENSOR_LEGS};
  sensors |= packet.body_velocity.empty() ? 0U : std::uint32_t{GEOFLOW_SENSOR_BODY_VELOCITY};
  return sensors;
}

void write_vector(double* out, const Vector3d& v) {
  Eigen::Map<Vector3d>{out} = v;
}

void write_quaternion(double* out, const Eigen::Quaterniond& q) {
  Eigen::Map<Eigen::Vector4d>{out} = q.coeffs();  // x, y, z, w
}

void write_covariance(double* out, const Matrix6d& covariance) {
  for (Eigen::Index row = 0; row < covariance.rows(); ++row) {
    for (Eigen::Index col = row; col < covariance.cols(); ++col) {
      *out++ = covariance(row, col);
    }
  }
}

std::int64_t nanoseconds(HostTime t) {
  return t.time_since_epoch().count();
}

/// What does not depend on what the estimate was made from.
geoflow_pose pose_of(const PoseEstimate& estimate, const PoseContext& context) {
  geoflow_pose pose{};
  pose.t_capture_ns = nanoseconds(estimate.t);
  pose.t_publish_ns = nanoseconds(context.t_publish);
  pose.t_recording_ns = nanoseconds(context.t_recording);
  pose.realtime_minus_mono_ns = realtime_minus_monotonic().count();
  const Matrix3d R_odom_base = estimate.T_odom_base.rotation_matrix();
  write_vector(&pose.p_odom_base[0], estimate.T_odom_base.translation());
  write_quaternion(&pose.q_odom_base[0], estimate.T_odom_base.rotation());
  write_vector(&pose.p_map_odom[0], estimate.T_map_odom.translation());
  write_quaternion(&pose.q_map_odom[0], estimate.T_map_odom.rotation());
  write_vector(&pose.v_base[0], R_odom_base.transpose() * estimate.v_odom_base);
  write_vector(&pose.w_base[0], estimate.w_base);
  write_covariance(&pose.covariance[0], odometry_covariance(estimate.covariance, R_odom_base));
  pose.status = static_cast<std::uint8_t>(estimate.status);
  pose.source = static_cast<std::uint8_t>(estimate.source);
  pose.quality = estimate.quality;
  pose.clock_flags = context.clock_flags;
  pose.reset_counter = context.earlier_resets + estimate.reset_counter;
  pose.map_id = estimate.map_id;
  pose.visual_inliers = estimate.visual_inliers;
  pose.depth_inliers = estimate.depth_inliers;
  pose.frames_dropped = static_cast<std::uint32_t>(context.frames_dropped);
  return pose;
}

}  // namespace

Result<RecordView> parse_record(std::span<const std::byte> bytes) {
  if (bytes.size() < sizeof(geoflow_header)) {
    return fail(ErrorCode::kInvalidData, "a record of {} bytes is shorter than its header",
                bytes.size());
  }
  RecordView view{.header = read_payload<geoflow_header>(bytes),
                  .payload = bytes.subspan(sizeof(geoflow_header))};
  if (view.header.magic != GEOFLOW_MAGIC) {
    return fail(ErrorCode::kInvalidData, "a record's magic is {:#010x}, not {:#010x}",
                view.header.magic, GEOFLOW_MAGIC);
  }
  if (view.header.payload_len != view.payload.size()) {
    return fail(ErrorCode::kInvalidData, "a record says {} bytes of payload but has {}",
                view.header.payload_len, view.payload.size());
  }
  return view;
}

tl::expected<Hello, Refusal> parse_hello(std::span<const std::byte> bytes) {
  const auto record = parse_record(bytes);
  if (!record) {
    return refuse(GEOFLOW_REFUSE_MALFORMED, record.error().message);
  }
  if (record->header.major != GEOFLOW_PROTOCOL_MAJOR) {
    return refuse(
        GEOFLOW_REFUSE_VERSION,
        fmt::format("protocol {}.{} is not spoken here, {}.{} is", record->header.major,
                    record->header.minor, GEOFLOW_PROTOCOL_MAJOR, GEOFLOW_PROTOCOL_MINOR));
  }
  if (record->header.type != GEOFLOW_HELLO || record->payload.size() < sizeof(geoflow_hello)) {
    return refuse(GEOFLOW_REFUSE_MALFORMED, "the first record must be a whole HELLO");
  }
  const auto hello = read_payload<geoflow_hello>(record->payload);
  if (!std::isfinite(hello.max_rate_hz) || hello.max_rate_hz < 0.0) {
    return refuse(GEOFLOW_REFUSE_MALFORMED, "max_rate_hz must be 0 or more");
  }
  return Hello{
      .name = printable({&hello.name[0], sizeof hello.name}),
      .max_rate_hz = hello.max_rate_hz,
      .wants_pose = (hello.want & GEOFLOW_WANT_POSE) != 0,
      .wants_propagated = (hello.want & GEOFLOW_WANT_PROPAGATED) != 0,
      .wants_frames = hello.want & (GEOFLOW_WANT_COLOR | GEOFLOW_WANT_DEPTH | GEOFLOW_WANT_CLOUD)};
}

std::vector<std::byte> encode_record(geoflow_record_type type, std::uint32_t dropped,
                                     std::uint64_t sequence, std::span<const std::byte> payload) {
  const geoflow_header header{.magic = GEOFLOW_MAGIC,
                              .major = GEOFLOW_PROTOCOL_MAJOR,
                              .minor = GEOFLOW_PROTOCOL_MINOR,
                              .type = static_cast<std::uint16_t>(type),
                              .payload_len = static_cast<std::uint32_t>(payload.size()),
                              .dropped = dropped,
                              .sequence = sequence};
  std::vector<std::byte> bytes(sizeof header + payload.size());
  std::memcpy(bytes.data(), &header, sizeof header);
  std::memcpy(bytes.data() + sizeof header, payload.data(), payload.size());
  return bytes;
}

Matrix6d odometry_covariance(const Matrix6d& covariance, const Matrix3d& R_odom_base) {
  Matrix6d turn = Matrix6d::Zero();
  turn.topRightCorner<3, 3>() = R_odom_base;    // position from the tangent's second half
  turn.bottomLeftCorner<3, 3>() = R_odom_base;  // rotation from its first
  return turn * covariance * turn.transpose();
}

geoflow_pose make_pose(const SyncedPacket& packet, const PoseEstimate& estimate,
                       const PoseContext& context) {
  geoflow_pose pose = pose_of(estimate, context);
  pose.t_arrival_ns = nanoseconds(packet.t_arrival);
  pose.t_frame_ns = pose.t_capture_ns;
  pose.sync_error_bound_ns = packet.error_bound.count();
  pose.frame = packet.sequence;
  pose.sensors = sensors_of(packet);
  return pose;
}

geoflow_pose make_pose(const PropagatedPose& propagated, const PoseContext& context) {
  geoflow_pose pose = pose_of(propagated.estimate, context);
  pose.t_arrival_ns = nanoseconds(propagated.t_arrival);
  pose.t_frame_ns = nanoseconds(propagated.t_frame);
  pose.sync_error_bound_ns = propagated.error_bound.count();
  pose.frame = propagated.estimate.sequence;
  pose.sensors = GEOFLOW_SENSOR_IMU;
  if (propagated.estimate.source == PoseSource::kLegs) {
    pose.sensors |= GEOFLOW_SENSOR_LEGS;
  }
  return pose;
}

Duration realtime_minus_monotonic() noexcept {
  const auto realtime = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<Duration>(realtime) - HostClock::now().time_since_epoch();
}

}  // namespace geoflow::daemon
