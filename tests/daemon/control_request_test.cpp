#include "protocol/control_request.hpp"

#include <string>
#include <variant>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace geoflow::daemon {
namespace {

using testing::HasSubstr;

TEST(ControlRequest, CommandsAreParsed) {
  const auto watch =
      parse_control_request(R"({"cmd":"watch","stream":"pose","rate_hz":2.5,"id":7})");
  ASSERT_TRUE(watch) << watch.error().message;
  EXPECT_EQ(std::get<WatchRequest>(watch->command).rate_hz, 2.5);
  EXPECT_EQ(watch->id, 7);
  EXPECT_TRUE(
      std::holds_alternative<StatusRequest>(parse_control_request(R"({"cmd":"status"})")->command));
  EXPECT_TRUE(std::holds_alternative<UnwatchRequest>(
      parse_control_request(R"({"cmd":"unwatch"})")->command));
  EXPECT_TRUE(
      std::holds_alternative<HelpRequest>(parse_control_request(R"({"cmd":"help"})")->command));
}

TEST(ControlRequest, ErrorsSayWhatIsWrong) {
  const auto error = [](const std::string& line) {
    return parse_control_request(line).error().message;
  };
  EXPECT_THAT(error(""), HasSubstr("one JSON object"));
  EXPECT_THAT(error("{"), HasSubstr("one JSON object"));
  EXPECT_THAT(error("[1]"), HasSubstr("one JSON object"));
  EXPECT_THAT(error(R"({"a":1})"), HasSubstr("cmd"));
  EXPECT_THAT(error(R"({"cmd":"reboot"})"), HasSubstr("help, status, watch, unwatch"));
  EXPECT_THAT(error(R"({"cmd":"status","rate_hz":1})"), HasSubstr("unknown key \"rate_hz\""));
  EXPECT_THAT(error(R"({"cmd":"watch","stream":"cloud"})"), HasSubstr("stream"));
  EXPECT_THAT(error(R"({"cmd":"watch","rate_hz":-1})"), HasSubstr("rate_hz"));
  EXPECT_THAT(error(R"({"cmd":"watch","rate_hz":"fast"})"), HasSubstr("rate_hz"));
  EXPECT_THAT(error(R"({"cmd":"status","id":{}})"), HasSubstr("id"));
}

TEST(ControlRequest, DepthAndLengthAreBounded) {
  EXPECT_THAT(parse_control_request(std::string(3000, '[')).error().message, HasSubstr("deep"));
  EXPECT_THAT(parse_control_request(R"({"cmd":"status","a":[[[[[[[[[1]]]]]]]]]})").error().message,
              HasSubstr("deep"));
  EXPECT_THAT(parse_control_request(std::string(5000, ' ')).error().message, HasSubstr("4096"));
}

}  // namespace
}  // namespace geoflow::daemon
