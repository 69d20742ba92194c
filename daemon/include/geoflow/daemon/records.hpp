#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/propagated_pose.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"

/// Records of the pose socket to and from bytes (docs/protocol.md). Pure; thread-safe.
namespace geoflow::daemon {

static_assert(std::endian::native == std::endian::little,
              "records are copied to and from the wire as they stand");

/// One record as received: `payload` points into the bytes that were parsed.
struct RecordView {
  geoflow_header header{};
  std::span<const std::byte> payload;
};

/// Splits one received datagram. kInvalidData, with what is wrong, for a short header, a foreign
/// magic, or a length that is not the datagram's. The version is the caller's to judge.
[[nodiscard]] Result<RecordView> parse_record(std::span<const std::byte> bytes);

/// The payload as this version's struct: what the sender appended later is left out, what it did
/// not yet have is zero.
template <typename Payload>
[[nodiscard]] Payload read_payload(std::span<const std::byte> payload) noexcept {
  static_assert(std::is_trivially_copyable_v<Payload>);
  Payload value{};
  std::memcpy(&value, payload.data(), std::min(payload.size(), sizeof value));
  return value;
}

/// What a client asked for.
struct Hello {
  std::string name;        ///< printable ASCII; everything else is replaced by '?'
  double max_rate_hz = 0;  ///< of poses, and of frames of each stream; 0: every one
  bool wants_pose = false;
  bool wants_propagated = false;
  std::uint32_t wants_frames = 0;  ///< GEOFLOW_WANT_COLOR, _DEPTH, _CLOUD, or-ed
};

/// Why a client is not welcome.
struct Refusal {
  geoflow_refusal reason = GEOFLOW_REFUSE_MALFORMED;
  std::string text;
};

/// Judges a client's first datagram.
[[nodiscard]] tl::expected<Hello, Refusal> parse_hello(std::span<const std::byte> bytes);

/// The bytes of one record.
[[nodiscard]] std::vector<std::byte> encode_record(geoflow_record_type type, std::uint32_t dropped,
                                                   std::uint64_t sequence,
                                                   std::span<const std::byte> payload);

template <typename Payload>
[[nodiscard]] std::vector<std::byte> encode_record(geoflow_record_type type, std::uint32_t dropped,
                                                   std::uint64_t sequence, const Payload& payload) {
  static_assert(std::is_trivially_copyable_v<Payload>);
  return encode_record(type, dropped, sequence, std::as_bytes(std::span{&payload, 1}));
}

/// Copies text into a fixed field, cut to leave a terminating zero.
template <std::size_t Size>
// NOLINTNEXTLINE(modernize-avoid-c-arrays): C header
void copy_text(char (&field)[Size], std::string_view text) noexcept {
  const std::size_t length = text.copy(&field[0], Size - 1);
  std::memset(&field[length], 0, Size - length);
}

/// What the pipeline knows of one estimate besides the estimate.
struct PoseContext {
  HostTime t_publish;
  HostTime t_recording;
  std::uint32_t clock_flags = 0;     ///< geoflow_clock_flags
  std::uint32_t earlier_resets = 0;  ///< added to the estimate's: of runs before this one
  std::uint64_t frames_dropped = 0;
};

/// The POSE payload of one packet's estimate. CLOCK_REALTIME's offset is read here.
[[nodiscard]] geoflow_pose make_pose(const SyncedPacket& packet, const PoseEstimate& estimate,
                                     const PoseContext& context);
/// Likewise of a pose that was carried on to an IMU sample.
[[nodiscard]] geoflow_pose make_pose(const PropagatedPose& propagated, const PoseContext& context);

/// Whether a pose was carried on from an earlier frame.
[[nodiscard]] constexpr bool is_propagated(const geoflow_pose& pose) noexcept {
  return pose.t_frame_ns != 0 && pose.t_frame_ns < pose.t_capture_ns;
}

/// The covariance of T_odom_base in nav_msgs' order and frame (x y z rx ry rz, rotation about
/// odom's axes) from this project's (rotation, translation; right perturbation). First order: both
/// blocks turned by R_odom_base.
[[nodiscard]] Matrix6d odometry_covariance(const Matrix6d& covariance, const Matrix3d& R_odom_base);

/// The same record with the same names as JSON; status and source by their names.
[[nodiscard]] nlohmann::json pose_to_json(const geoflow_pose& pose);

/// The name of a pose's status: `TRACKING`; its number where it has none.
[[nodiscard]] std::string status_name(std::uint8_t status);

/// CLOCK_REALTIME - CLOCK_MONOTONIC now.
[[nodiscard]] Duration realtime_minus_monotonic() noexcept;

}  // namespace geoflow::daemon
