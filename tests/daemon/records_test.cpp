#include "geoflow/daemon/records.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/propagated_pose.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"

extern "C" int geoflow_c_read_pose(const void* record, size_t size, double* x, unsigned* status);

namespace geoflow::daemon {
namespace {

using testing::HasSubstr;

/// A pose whose every field has its own value.
geoflow_pose numbered_pose() {
  geoflow_pose pose{};
  pose.t_capture_ns = 1;
  pose.t_arrival_ns = 2;
  pose.t_publish_ns = 3;
  pose.t_recording_ns = 4;
  pose.realtime_minus_mono_ns = 5;
  pose.sync_error_bound_ns = 6;
  pose.frame = 7;
  double next = 8;
  for (const std::span<double> field :
       {std::span<double>{pose.p_odom_base}, std::span<double>{pose.q_odom_base},
        std::span<double>{pose.p_map_odom}, std::span<double>{pose.q_map_odom},
        std::span<double>{pose.v_base}, std::span<double>{pose.w_base},
        std::span<double>{pose.covariance}}) {
    for (double& value : field) {
      value = next++;
    }
  }
  pose.status = GEOFLOW_TRACKING;
  pose.source = 3;
  pose.quality = 99;
  pose.clock_flags = GEOFLOW_CLOCK_REPLAY;
  pose.reset_counter = 101;
  pose.map_id = 102;
  pose.visual_inliers = 103;
  pose.depth_inliers = 104;
  pose.sensors = GEOFLOW_SENSOR_COLOR | GEOFLOW_SENSOR_DEPTH;
  pose.frames_dropped = 106;
  return pose;
}

std::string hexadecimal(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte byte : bytes) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    text += kDigits[std::to_integer<unsigned>(byte >> 4U)];
    text += kDigits[std::to_integer<unsigned>(byte & std::byte{15})];
  }
  return text;
}

/// A record as protocol 1.0 had it: the sender's minor version is 0, and nothing is appended.
std::string as_version_one_zero(std::span<const std::byte> record, std::size_t payload_bytes) {
  std::vector<std::byte> bytes{record.begin(), record.end()};
  bytes.resize(sizeof(geoflow_header) + payload_bytes);
  auto header = read_payload<geoflow_header>(bytes);
  EXPECT_EQ(header.minor, GEOFLOW_PROTOCOL_MINOR);
  header.minor = 0;
  header.payload_len = static_cast<std::uint32_t>(payload_bytes);
  std::memcpy(bytes.data(), &header, sizeof header);
  return hexadecimal(bytes);
}

// What protocol 1.0 looks like on the wire. These bytes never change: a change of them is a new
// version.
TEST(ProtocolOne, GoldenBytesOfHeaderHelloEndAndRefuse) {
  geoflow_hello hello{};
  hello.client_major = 1;
  hello.want = GEOFLOW_WANT_POSE;
  hello.max_rate_hz = 2.0;
  copy_text(hello.name, "abc");
  EXPECT_EQ(
      as_version_one_zero(encode_record(GEOFLOW_HELLO, 0, 0, hello), sizeof hello),
      "464c4f5701000100300000000000000000000000000000000100000001000000000000000000004061626300"
      "00000000000000000000000000000000000000000000000000000000");
  const geoflow_end end{.reason = GEOFLOW_END_REPLAYED, .reserved = 0};
  EXPECT_EQ(as_version_one_zero(encode_record(GEOFLOW_END, 0x01020304, 0x1122334455667788, end),
                                sizeof end),
            "464c4f5701000500080000000403020188776655443322110200000000000000");
}

TEST(ProtocolOne, GoldenBytesOfPose) {
  const auto bytes = encode_record(GEOFLOW_POSE, 9, 10, numbered_pose());
  constexpr std::size_t kPayload = 416;
  const std::string text = as_version_one_zero(bytes, kPayload);
  EXPECT_EQ(text.substr(0, 48), "464c4f5701000400a0010000090000000a00000000000000");
  EXPECT_EQ(text.substr(48, 128),
            "0100000000000000020000000000000003000000000000000400000000000000"
            "0500000000000000060000000000000007000000000000000000000000002040");
  EXPECT_EQ(text.substr(text.size() - 64),
            "02036300010000006500000066000000670000006800000003000000"
            "6a000000");
  for (std::size_t i = 0; i < 41; ++i) {  // the doubles count up from 8 without a gap
    double value = 0;
    std::memcpy(&value, bytes.data() + sizeof(geoflow_header) + 56 + i * sizeof value,
                sizeof value);
    EXPECT_EQ(value, static_cast<double>(8 + i));
  }
}

// What 1.1 appends.
TEST(ProtocolOne, GoldenBytesOfPoseSinceOneOne) {
  auto pose = numbered_pose();
  pose.t_frame_ns = 0x0102030405060708;
  const auto bytes = encode_record(GEOFLOW_POSE, 9, 10, pose);
  ASSERT_EQ(bytes.size(), 448U);
  const std::string text = hexadecimal(bytes);
  EXPECT_EQ(text.substr(0, 48), "464c4f5701020400a8010000090000000a00000000000000");
  EXPECT_EQ(text.substr(text.size() - 16), "0807060504030201");
}

TEST(ProtocolOne, APoseIsPropagatedWhereItsFrameIsEarlier) {
  geoflow_pose pose{};
  pose.t_capture_ns = 10;
  EXPECT_FALSE(is_propagated(pose)) << "a daemon of 1.0";
  pose.t_frame_ns = 10;
  EXPECT_FALSE(is_propagated(pose));
  pose.t_frame_ns = 9;
  EXPECT_TRUE(is_propagated(pose));
}

TEST(ProtocolOne, ACProgramReadsThePoseWithTheHeaderAlone) {
  const auto bytes = encode_record(GEOFLOW_POSE, 0, 0, numbered_pose());
  double x = 0;
  unsigned status = 0;
  ASSERT_EQ(geoflow_c_read_pose(bytes.data(), bytes.size(), &x, &status), 0);
  EXPECT_EQ(x, 8.0);
  EXPECT_EQ(status, static_cast<unsigned>(GEOFLOW_TRACKING));
}

TEST(Records, ParseRefusesWhatIsNotARecord) {
  auto bytes = encode_record(GEOFLOW_POSE, 0, 0, numbered_pose());
  EXPECT_TRUE(parse_record(bytes));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_FALSE(parse_record(std::span{bytes}.first(size))) << size;
  }
  bytes[0] = std::byte{0};
  EXPECT_THAT(parse_record(bytes).error().message, HasSubstr("magic"));
}

TEST(Records, ReadersTakeWhatTheyKnowAndZeroTheRest) {
  const auto pose = numbered_pose();
  auto grown = encode_record(GEOFLOW_POSE, 0, 0, pose);
  grown.resize(grown.size() + 8);  // a later minor version
  const auto payload = std::span<const std::byte>{grown}.subspan(sizeof(geoflow_header));
  EXPECT_EQ(read_payload<geoflow_pose>(payload).frames_dropped, 106U);
  const auto shorter = read_payload<geoflow_pose>(payload.first(412));  // an earlier one
  EXPECT_EQ(shorter.sensors, pose.sensors);
  EXPECT_EQ(shorter.frames_dropped, 0U);
}

TEST(Records, HelloIsJudged) {
  geoflow_hello hello{};
  hello.want = GEOFLOW_WANT_POSE;
  copy_text(hello.name, "na\nme\x1b[31m");
  const auto good = parse_hello(encode_record(GEOFLOW_HELLO, 0, 0, hello));
  ASSERT_TRUE(good);
  EXPECT_EQ(good->name, "na?me?[31m");
  EXPECT_TRUE(good->wants_pose);
  EXPECT_FALSE(good->wants_propagated);
  hello.max_rate_hz = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(parse_hello(encode_record(GEOFLOW_HELLO, 0, 0, hello)).error().reason,
            GEOFLOW_REFUSE_MALFORMED);
  hello.max_rate_hz = 0;
  EXPECT_EQ(parse_hello(encode_record(GEOFLOW_POSE, 0, 0, hello)).error().reason,
            GEOFLOW_REFUSE_MALFORMED);
  auto newer = encode_record(GEOFLOW_HELLO, 0, 0, hello);
  newer[4] = std::byte{2};
  const auto refused = parse_hello(newer);
  EXPECT_EQ(refused.error().reason, GEOFLOW_REFUSE_VERSION);
  EXPECT_THAT(refused.error().text, HasSubstr("1.2"));
}

TEST(Records, OdometryCovarianceIsThatOfThePoseInOdomAxes) {
  // Sampled: perturb T on the right, look at position and rotation in odom's axes.
  const SE3 T_odom_base{so3::exp({0.3, -0.5, 1.1}), {1.0, 2.0, 3.0}};
  Matrix6d root = Matrix6d::Identity() * 0.01;
  root(0, 4) = 0.004;
  root(2, 3) = -0.006;
  const Matrix6d covariance = root * root.transpose();
  const Matrix6d odometry = odometry_covariance(covariance, T_odom_base.rotation_matrix());
  Matrix6d sampled = Matrix6d::Zero();
  for (Eigen::Index i = 0; i < 6; ++i) {  // sigma points along the root's columns
    for (const double sign : {-1.0, 1.0}) {
      const SE3 moved = T_odom_base * SE3::exp(sign * 1e-3 * root.col(i));
      Vector6d error;
      error.head<3>() = moved.translation() - T_odom_base.translation();
      error.tail<3>() = so3::log(moved.rotation() * T_odom_base.rotation().inverse());
      sampled += 0.5 * 1e6 * error * error.transpose();
    }
  }
  EXPECT_LT((sampled - odometry).norm(), 1e-6 * odometry.norm());
}

TEST(Records, MakePoseFillsFromPacketAndEstimate) {
  SyncedPacket packet;
  packet.sequence = 12;
  packet.t_arrival = HostTime{Duration{20}};
  packet.error_bound = Duration{30};
  packet.imu.resize(1);
  PoseEstimate estimate;
  estimate.t = HostTime{Duration{10}};
  estimate.status = TrackingStatus::kDegraded;
  estimate.source = PoseSource::kGicp;
  estimate.T_odom_base = SE3{so3::exp({0, 0, std::acos(0.0)}), {1, 2, 3}};
  estimate.v_odom_base = {0, 5, 0};
  estimate.reset_counter = 1;
  const auto pose = make_pose(packet, estimate,
                              {.t_publish = HostTime{Duration{40}},
                               .t_recording = HostTime{Duration{50}},
                               .clock_flags = GEOFLOW_CLOCK_REPLAY,
                               .earlier_resets = 2,
                               .frames_dropped = 60});
  EXPECT_EQ(pose.t_capture_ns, 10);
  EXPECT_EQ(pose.t_arrival_ns, 20);
  EXPECT_EQ(pose.t_publish_ns, 40);
  EXPECT_EQ(pose.t_recording_ns, 50);
  EXPECT_EQ(pose.sync_error_bound_ns, 30);
  EXPECT_EQ(pose.frame, 12U);
  EXPECT_EQ(pose.sensors, static_cast<std::uint32_t>(GEOFLOW_SENSOR_IMU));
  EXPECT_EQ(pose.reset_counter, 3U);
  EXPECT_EQ(pose.frames_dropped, 60U);
  EXPECT_NEAR(pose.v_base[0], 5.0, 1e-12);  // odom's y is base's x after a quarter turn
  EXPECT_NEAR(pose.q_odom_base[3], std::sqrt(0.5), 1e-12);
  const auto json = pose_to_json(pose);
  EXPECT_EQ(json["status"], "DEGRADED");
  EXPECT_EQ(json["source"], "gicp");
  EXPECT_EQ(json["sensors"], nlohmann::json::array({"imu"}));
  EXPECT_EQ(json["covariance"].size(), 21U);
}

TEST(Records, MakePoseOfAPropagatedOneNamesItsFrame) {
  PropagatedPose propagated;
  propagated.estimate.t = HostTime{Duration{10}};
  propagated.estimate.sequence = 7;
  propagated.estimate.source = PoseSource::kLegs;
  propagated.t_frame = HostTime{Duration{4}};
  propagated.t_arrival = HostTime{Duration{12}};
  propagated.error_bound = Duration{3};
  const auto pose = make_pose(propagated, {.t_publish = HostTime{Duration{14}},
                                           .t_recording = HostTime{Duration{10}},
                                           .earlier_resets = 2});
  EXPECT_EQ(pose.t_capture_ns, 10);
  EXPECT_EQ(pose.t_frame_ns, 4);
  EXPECT_EQ(pose.t_arrival_ns, 12);
  EXPECT_EQ(pose.sync_error_bound_ns, 3);
  EXPECT_EQ(pose.frame, 7U);
  EXPECT_EQ(pose.sensors, static_cast<std::uint32_t>(GEOFLOW_SENSOR_IMU | GEOFLOW_SENSOR_LEGS));
  EXPECT_EQ(pose.reset_counter, 2U);
  EXPECT_EQ(pose_to_json(pose)["propagated"], true);
}

TEST(Records, StatusAndSourceNumbersAreThoseOfTheVocabulary) {
  EXPECT_EQ(static_cast<int>(TrackingStatus::kStarting), static_cast<int>(GEOFLOW_STARTING));
  EXPECT_EQ(static_cast<int>(TrackingStatus::kTracking), static_cast<int>(GEOFLOW_TRACKING));
  EXPECT_EQ(static_cast<int>(TrackingStatus::kLost), static_cast<int>(GEOFLOW_LOST));
  EXPECT_EQ(static_cast<int>(PoseSource::kConstantVelocity), 5);
  EXPECT_EQ(static_cast<int>(PoseSource::kPnp), 3);
}

}  // namespace
}  // namespace geoflow::daemon
