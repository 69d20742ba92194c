#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"

#include "geoflow_client.h"
#include "golden.hpp"

namespace geoflow {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;
using Bytes = std::vector<std::byte>;

class CClient : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override { ASSERT_EQ(records_.size(), GetParam() == "1.2" ? 7U : 5U); }
  [[nodiscard]] const Bytes& record(const std::string& name) const { return records_.at(name); }
  [[nodiscard]] bool is_first() const { return GetParam() == "1.0"; }

  const std::map<std::string, Bytes> records_ = tests::golden_records(GetParam());
};

TEST_P(CClient, ReadsThePose) {
  geoflow_header header{};
  geoflow_pose pose{};
  const Bytes& bytes = record("pose");
  ASSERT_EQ(geoflow_parse(bytes.data(), bytes.size(), &header, &pose, sizeof pose), 0);
  EXPECT_EQ(header.type, GEOFLOW_POSE);
  EXPECT_EQ(header.dropped, 9U);
  EXPECT_EQ(header.sequence, 10U);
  EXPECT_EQ(pose.t_capture_ns, 1);
  EXPECT_EQ(pose.sync_error_bound_ns, 6);
  EXPECT_EQ(pose.frame, 7U);
  EXPECT_EQ(pose.p_odom_base[0], 8.0);
  EXPECT_EQ(pose.q_odom_base[3], 14.0);
  EXPECT_EQ(pose.q_map_odom[3], 21.0);
  EXPECT_EQ(pose.w_base[2], 27.0);
  EXPECT_EQ(pose.covariance[20], 48.0);
  EXPECT_STREQ(geoflow_status_name(pose.status), "TRACKING");
  EXPECT_EQ(pose.quality, 99);
  EXPECT_EQ(pose.reset_counter, 101U);
  EXPECT_EQ(pose.frames_dropped, 106U);
  EXPECT_EQ(pose.t_frame_ns, is_first() ? 0 : 0x0102030405060708);
}

TEST_P(CClient, ReadsTheOthers) {
  geoflow_header header{};
  geoflow_welcome welcome{};
  geoflow_refuse refuse{};
  geoflow_end end{};
  const auto read = [&](const std::string& name, void* payload, std::size_t size) {
    return geoflow_parse(record(name).data(), record(name).size(), &header, payload, size);
  };
  ASSERT_EQ(read("welcome", &welcome, sizeof welcome), 0);
  EXPECT_EQ(welcome.client_id, 11U);
  EXPECT_EQ(welcome.boot_id[15], 31);
  EXPECT_EQ(welcome.stall_timeout_ms, 5000U);
  EXPECT_STREQ(&welcome.version[0], "0.1.0");
  ASSERT_EQ(read("refuse", &refuse, sizeof refuse), 0);
  EXPECT_EQ(refuse.reason, static_cast<std::uint32_t>(GEOFLOW_REFUSE_FULL));
  EXPECT_STREQ(&refuse.text[0], "too many clients");
  ASSERT_EQ(read("end", &end, sizeof end), 0);
  EXPECT_EQ(end.reason, static_cast<std::uint32_t>(GEOFLOW_END_REPLAYED));
}

TEST_P(CClient, TheDaemonReadsTheHello) {
  const auto hello = daemon::parse_hello(record("hello"));
  ASSERT_TRUE(hello);
  EXPECT_EQ(hello->name, "abc");
  EXPECT_EQ(hello->max_rate_hz, 2.0);
  EXPECT_TRUE(hello->wants_pose);
}

INSTANTIATE_TEST_SUITE_P(Versions, CClient, testing::Values("1.0", "1.1", "1.2"));

/// What the daemon of this version writes is what is frozen.
TEST(Golden, TheDaemonWritesThePose) {
  const auto records = tests::golden_records("1.2");
  const Bytes& golden = records.at("pose");
  const auto view = daemon::parse_record(golden);
  ASSERT_TRUE(view) << view.error().message;
  const auto pose = daemon::read_payload<geoflow_pose>(view->payload);
  EXPECT_THAT(daemon::encode_record(GEOFLOW_POSE, 9, 10, pose), ElementsAreArray(golden));
}

TEST(Golden, RingsAndFramesAreReadAndWrittenAsTheyAre) {
  const auto records = tests::golden_records("1.2");
  geoflow_header header{};
  geoflow_ring ring{};
  geoflow_frame frame{};
  const auto read = [&](const Bytes& bytes, void* payload, std::size_t size) {
    return geoflow_parse(bytes.data(), bytes.size(), &header, payload, size);
  };
  ASSERT_EQ(read(records.at("ring"), &ring, sizeof ring), 0);
  EXPECT_EQ(header.type, GEOFLOW_RING);
  EXPECT_EQ(ring.ring, 1U);
  EXPECT_EQ(ring.slots, 5U);
  EXPECT_EQ(ring.intrinsics[0], 8.0);
  EXPECT_EQ(ring.distortion[4], 16.0);
  EXPECT_EQ(ring.unit_m, 17.0);
  ASSERT_EQ(read(records.at("frame"), &frame, sizeof frame), 0);
  EXPECT_EQ(header.type, GEOFLOW_FRAME);
  EXPECT_EQ(frame.t_capture_ns, 1);
  EXPECT_EQ(frame.bytes, 6U);
  EXPECT_EQ(frame.stream, 7U);
  EXPECT_EQ(frame.stride, 12U);
  EXPECT_THAT(daemon::encode_record(GEOFLOW_RING, 9, 10, ring),
              ElementsAreArray(records.at("ring")));
  EXPECT_THAT(daemon::encode_record(GEOFLOW_FRAME, 9, 10, frame),
              ElementsAreArray(records.at("frame")));
}

TEST(CClientBytes, TheHelloIsTheGoldenOne) {
  const geoflow_options options{
      .socket = nullptr, .name = "abc", .want = GEOFLOW_WANT_POSE, .max_rate_hz = 2.0};
  std::array<unsigned char, 72> hello{};
  geoflow_make_hello(&options, hello.data());
  const Bytes golden = tests::golden_records("1.2").at("hello");
  ASSERT_EQ(golden.size(), hello.size());
  EXPECT_EQ(std::memcmp(golden.data(), hello.data(), hello.size()), 0);
}

TEST(CClientBytes, WhatIsNoRecordIsRefused) {
  Bytes bytes = tests::golden_records("1.2").at("pose");
  geoflow_header header{};
  geoflow_pose pose{};
  EXPECT_EQ(geoflow_parse(bytes.data(), 23, &header, &pose, sizeof pose), -1);
  EXPECT_EQ(geoflow_parse(bytes.data(), bytes.size() - 1, &header, &pose, sizeof pose), -1);
  bytes[0] = std::byte{0};
  EXPECT_EQ(geoflow_parse(bytes.data(), bytes.size(), &header, &pose, sizeof pose), -1);
}

TEST(CClientBytes, TheBaseInTheMapIsBothTransforms) {
  geoflow_pose pose{};
  const double half = std::sqrt(0.5);
  pose.p_map_odom[0] = 10;
  pose.q_map_odom[2] = half;  // a quarter turn to the left
  pose.q_map_odom[3] = half;
  pose.p_odom_base[0] = 1;
  pose.q_odom_base[2] = half;
  pose.q_odom_base[3] = half;
  std::array<double, 3> p{};
  std::array<double, 4> q{};
  geoflow_map_from_base(&pose, p.data(), q.data());
  EXPECT_NEAR(p[0], 10, 1e-12);
  EXPECT_NEAR(p[1], 1, 1e-12);
  EXPECT_NEAR(q[2], 1, 1e-12);  // half a turn
  EXPECT_NEAR(q[3], 0, 1e-12);
}

TEST(CClientErrors, NameWhatIsWrong) {
  geoflow_client client{};
  geoflow_options options{};
  options.socket = "/nonexistent/pose.sock";
  EXPECT_EQ(geoflow_connect(&client, &options), -1);
  EXPECT_THAT(&client.error[0], HasSubstr("/nonexistent/pose.sock: No such file"));
  const std::string long_path(200, 'x');
  options.socket = long_path.c_str();
  EXPECT_EQ(geoflow_connect(&client, &options), -1);
  EXPECT_THAT(&client.error[0], HasSubstr("at most"));
  geoflow_close(&client);
  EXPECT_STREQ(geoflow_status_name(77), "UNKNOWN");
}

}  // namespace
}  // namespace geoflow
