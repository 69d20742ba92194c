#include "can/leg_dictionary.hpp"

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/bus_fixture.hpp"
#include "can/candump.hpp"
#include "can/dbc/database.hpp"
#include "can/frame.hpp"
#include "can/leg_encoder.hpp"

namespace geoflow::drivers::can {
namespace {

using testing::HasSubstr;
using tests::dictionary;
using tests::frame;

/// The value of a quantity in one frame by the shipped dictionary.
double value(const Frame& of, Quantity quantity, std::size_t index) {
  const auto match = dictionary().match(of);
  EXPECT_EQ(match.kind, FrameKind::kLeg);
  for (const LegField& field : dictionary().groups().at(match.group).fields) {
    if (field.quantity == quantity && field.index == index) {
      return field.signal.decode(of.payload());
    }
  }
  ADD_FAILURE() << "not in this frame";
  return 0;
}

TEST(ShippedDictionary, IsTheFileInConfigAndHasSyncAndAllJoints) {
  const auto file = LegDictionary::load(GEOFLOW_CONFIG_FOLDER "/go2_legs.dbc");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->identifiers(), dictionary().identifiers());
  EXPECT_EQ(dictionary().groups().size(), 16U);  // POS, VEL, TAU and the FD frame of four legs
  EXPECT_EQ(dictionary().identifiers().size(), 20U);
  ASSERT_TRUE(dictionary().sync());
  EXPECT_EQ(dictionary().sync()->period, Duration{167'772'160'000});  // 2^24 of 10 us
}

// Frames worked out by hand from the dictionary's numbers.
TEST(ShippedDictionary, KnownFramesAreRead) {
  const Frame pos = frame("110#0CFE9411D8DC0701");
  EXPECT_DOUBLE_EQ(value(pos, Quantity::kAngle, 0), -0.1);
  EXPECT_DOUBLE_EQ(value(pos, Quantity::kAngle, 1), 0.9);
  EXPECT_DOUBLE_EQ(value(pos, Quantity::kAngle, 2), -1.8);
  EXPECT_EQ(dictionary().groups()[dictionary().match(pos).group].sequence->raw(pos.payload()), 7U);
  const Frame vel = frame("123#FA0013E8CA3AFBFF");
  EXPECT_DOUBLE_EQ(value(vel, Quantity::kRate, 9), 0.5);
  EXPECT_NEAR(value(vel, Quantity::kRate, 10), -12.25, 0.001);
  EXPECT_DOUBLE_EQ(value(vel, Quantity::kRate, 11), 30.1);
  EXPECT_EQ(value(vel, Quantity::kFootForce, 3), -5);
  const Frame tau = frame("132#EFD83200BB583930");
  EXPECT_NEAR(value(tau, Quantity::kTorque, 6), -20.002, 1e-9);
  EXPECT_NEAR(value(tau, Quantity::kTorque, 7), 0.1, 1e-9);
  EXPECT_NEAR(value(tau, Quantity::kTorque, 8), 45.43, 1e-3);
  const Frame fd = frame("213##1000000002CCF00006A180000EFD8000000007800FF000000");
  EXPECT_DOUBLE_EQ(value(fd, Quantity::kAngle, 11), -2.5);
  EXPECT_DOUBLE_EQ(value(fd, Quantity::kRate, 10), 12.5);
  EXPECT_NEAR(value(fd, Quantity::kTorque, 9), -20.002, 1e-9);
  EXPECT_EQ(value(fd, Quantity::kFootForce, 3), 120);
}

TEST(ShippedDictionary, OtherFramesAreToldApart) {
  const auto kind = [](std::string_view text) { return dictionary().match(frame(text)).kind; };
  EXPECT_EQ(kind("080#0100000000"), FrameKind::kSync);
  EXPECT_EQ(kind("140#0000000000000000"), FrameKind::kOther);
  EXPECT_EQ(kind("7E8#0000000000000000"), FrameKind::kForeign);
  EXPECT_EQ(kind("00000110#0000000000000000"), FrameKind::kForeign);  // 29-bit 0x110
  EXPECT_EQ(kind("110#R"), FrameKind::kForeign);
  EXPECT_EQ(kind("20000110#0000000000000000"), FrameKind::kForeign);  // an error report
  EXPECT_EQ(kind("110#00000000000000"), FrameKind::kTooShort);
}

TEST(MitDictionary, RepliesAreToldApartByTheirFirstByte) {
  const auto mit = LegDictionary::load(GEOFLOW_CONFIG_FOLDER "/mit_actuators.dbc");
  ASSERT_TRUE(mit) << mit.error().message;
  EXPECT_FALSE(mit->sync());
  EXPECT_EQ(mit->groups().size(), 12U);
  // Actuator 5 (FL thigh): position 0xFFFF of +-12.5, velocity 0 of +-65, torque 0xFFF of +-18.
  const Frame reply = frame("000#05FFFF000FFF");
  const auto match = mit->match(reply);
  ASSERT_EQ(match.kind, FrameKind::kLeg);
  const FieldGroup& group = mit->groups()[match.group];
  EXPECT_EQ(group.leg, Leg::kFrontLeft);
  ASSERT_EQ(group.fields.size(), 3U);
  EXPECT_EQ(group.fields[0].index, 4U);
  EXPECT_NEAR(group.fields[0].signal.decode(reply.payload()), 12.5, 1e-6);
  EXPECT_NEAR(group.fields[1].signal.decode(reply.payload()), -65.0, 1e-6);
  EXPECT_NEAR(group.fields[2].signal.decode(reply.payload()), 18.0, 1e-6);
  EXPECT_EQ(mit->match(frame("000#0DFFFF000FFF")).kind, FrameKind::kOther);    // actuator 13
  EXPECT_EQ(mit->match(frame("000#05FFFF000FFF1900")).kind, FrameKind::kLeg);  // with temperature
}

/// The shipped dictionary with one text replaced by another.
std::string changed(std::string_view from, std::string_view to) {
  std::string text{shipped_dictionary()};
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string error_of(const std::string& text) {
  const auto database = dbc::parse(text, "t.dbc");
  if (!database) {
    return database.error().message;
  }
  const auto made = LegDictionary::from(*database);
  EXPECT_FALSE(made);
  return made ? std::string{} : made.error().message;
}

TEST(LegDictionary, WhatLegsCannotBeReadFromIsAnErrorWithItsLine) {
  std::string without_rate = changed("FL_calf_dq", "FL_calf_speed");
  without_rate.replace(without_rate.find("FL_calf_dq"), 10, "FL_calf_speed");  // of the FD frame
  EXPECT_THAT(error_of(without_rate), HasSubstr("t.dbc: no message has a signal FL_calf_dq"));
  EXPECT_THAT(error_of(changed("FR_hip_q : 0|16@1- (0.0002,0) [-6.5536|6.5534] \"rad\"",
                               "FR_hip_q : 0|16@1- (0.0115,0) [-375|375] \"deg\"")),
              testing::AllOf(testing::StartsWith("t.dbc:"),
                             HasSubstr("signal FR_hip_q of message FR_POS: has the unit 'deg'; it "
                                       "must be in rad")));
  EXPECT_THAT(error_of(changed("SG_ FR_status", "SG_ FL_seq")),
              HasSubstr("values of two legs (FR and FL) in one message"));
  EXPECT_THAT(error_of(changed("FR_seq : 48|8@1+ (1,0)", "FR_seq : 48|8@1+ (2,0)")),
              HasSubstr("FR_seq of message FR_POS: must be an unsigned counter"));
  EXPECT_THAT(error_of(changed("SG_ seq :", "SG_ counter :")),
              HasSubstr("message SYNC has no signal seq"));
  EXPECT_THAT(error_of(changed("(0.00001,0) [0|167.77215] \"s\"", "(10,0) [0|0] \"us\"")),
              HasSubstr("time_10us of message SYNC must be an unsigned time in s"));
  EXPECT_THAT(error_of(changed("SG_ FR_hip_q :", "SG_ FR_hip_q m1 :")),
              HasSubstr("where there is a multiplexor (M)"));
}

TEST(LegDictionary, AClockThatBeginsAgainAtOnceOrInAgesIsAnError) {
  const auto error_with_unit_of = [](std::string_view seconds) {
    const std::string scale = "(" + std::string{seconds} + ",0) [0|0]";
    return error_of(changed("(0.00001,0) [0|167.77215]", scale));
  };
  EXPECT_THAT(error_with_unit_of("7e14"),
              HasSubstr("time_10us of message SYNC begins again every 1.174405"));
  EXPECT_THAT(error_with_unit_of("1e-20"), HasSubstr("must be 0.01 to 1000000000 s"));
}

TEST(LegEncoder, WhatIsWrittenIsReadBackWithinAStep) {
  const LegSample sample = tests::sample_of(3);
  for (const bool fd : {false, true}) {
    const auto frames = LegEncoder{dictionary(), fd}.encode(sample, 300, Duration{1'234'560'000});
    ASSERT_EQ(frames.size(), fd ? 5U : 13U);
    EXPECT_EQ(frames[0].id, 0x80U);
    EXPECT_EQ(dictionary().sync()->sequence.raw(frames[0].payload()), 300U % 256U);
    EXPECT_DOUBLE_EQ(dictionary().sync()->time->decode(frames[0].payload()), 1.23456);
    for (std::size_t i = 1; i < frames.size(); ++i) {
      EXPECT_EQ(frames[i].fd, fd);
      const auto match = dictionary().match(frames[i]);
      ASSERT_EQ(match.kind, FrameKind::kLeg);
      for (const LegField& field : dictionary().groups()[match.group].fields) {
        const double read = field.signal.decode(frames[i].payload());
        EXPECT_NEAR(read, tests::value_of(sample, field), 0.5 * field.signal.factor + 1e-9)
            << field.signal.name;
      }
    }
  }
}

}  // namespace
}  // namespace geoflow::drivers::can
