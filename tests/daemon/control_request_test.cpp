#include "protocol/control_request.hpp"

#include <string>
#include <utility>
#include <variant>
#include <vector>

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

TEST(ControlRequest, ChangesAreParsed) {
  const auto change = [](const std::string& line) {
    return std::get<ChangeRequest>(parse_control_request(line).value().command).change;
  };
  EXPECT_EQ(change(R"({"cmd":"map","do":"save"})"), Change::kSaveMap);
  EXPECT_EQ(change(R"({"cmd":"map","do":"reset"})"), Change::kResetMap);
  EXPECT_EQ(change(R"({"cmd":"map","do":"load","file":"/a.map"})"), Change::kLoadMap);
  EXPECT_EQ(change(R"({"cmd":"reset"})"), Change::kReset);
  EXPECT_EQ(change(R"({"cmd":"reload"})"), Change::kReload);
}

/// Requests that are wrong, and a part of what is said of each.
using Wrong = std::vector<std::pair<std::string, std::string>>;

void expect_errors(const Wrong& wrong) {
  for (const auto& [line, message] : wrong) {
    const auto request = parse_control_request(line);
    ASSERT_FALSE(request) << line;
    EXPECT_THAT(request.error().message, HasSubstr(message)) << line;
  }
}

TEST(ControlRequest, ErrorsSayWhatIsWrong) {
  expect_errors(
      {{"", "one JSON object"},
       {"{", "one JSON object"},
       {"[1]", "one JSON object"},
       {R"({"a":1})", "cmd"},
       {R"({"cmd":"reboot"})", "help, status, watch, unwatch, config, map, reset, reload"},
       {R"({"cmd":"status","id":{}})", "id"}});
}

TEST(ControlRequest, ErrorsNameTheKey) {
  expect_errors(
      {{R"({"cmd":"status","rate_hz":1})", "unknown key \"rate_hz\""},
       {R"({"cmd":"watch","stream":"cloud"})", "stream"},
       {R"({"cmd":"watch","rate_hz":-1})", "rate_hz"},
       {R"({"cmd":"watch","rate_hz":"fast"})", "rate_hz"},
       {R"({"cmd":"map"})", "do: must be \"save\", \"load\" or \"reset\""},
       {R"({"cmd":"map","do":"burn"})", "do: must be"},
       {R"({"cmd":"map","do":"save","file":"x"})", "unknown key \"file\""},
       {R"({"cmd":"map","do":"load"})", "file: must be the path of a map"},
       {R"({"cmd":"map","do":"load","file":7})", "file: must be the path of a map"},
       {R"({"cmd":"map","do":"load","file":"a.map"})", "'a.map' must be an absolute path"},
       {R"({"cmd":"reset","do":"save"})", "unknown key \"do\""}});
}

TEST(ControlRequest, DepthAndLengthAreBounded) {
  EXPECT_THAT(parse_control_request(std::string(3000, '[')).error().message, HasSubstr("deep"));
  EXPECT_THAT(parse_control_request(R"({"cmd":"status","a":[[[[[[[[[1]]]]]]]]]})").error().message,
              HasSubstr("deep"));
  EXPECT_THAT(parse_control_request(std::string(5000, ' ')).error().message, HasSubstr("4096"));
}

}  // namespace
}  // namespace geoflow::daemon
