#include "top/table.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace geoflow::tools {
namespace {

using nlohmann::json;
using testing::Contains;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::Not;

json at(double uptime_s, int frames, int delivered) {
  return {{"version", "1.2.3"},
          {"pid", 42},
          {"uptime_s", uptime_s},
          {"summary", "TRACKING 30 Hz"},
          {"frames", frames},
          {"drops", {{"color", frames / 10}, {"depth", 0}, {"samples", 0}, {"packets", 0}}},
          {"health",
           {{"camera",
             {{"state", "streaming"},
              {"reason", ""},
              {"delivered", delivered},
              {"rejected", 1},
              {"dropped", 0}}}}},
          {"times_ms",
           {{"process",
             {{"count", frames}, {"mean", 12.5}, {"p50", 12.0}, {"p99", 20.0}, {"max", 31.0}}},
            {"gicp", {{"count", 0}, {"mean", 0}, {"p50", 0}, {"p99", 0}, {"max", 0}}}}},
          {"peak_memory_mib", 100}};
}

TEST(TopTable, RatesAreWhatHasGrownASecond) {
  const json grown = rates(at(10, 300, 600), at(12, 360, 720));
  EXPECT_EQ(grown["frames_hz"], 30.0);
  EXPECT_EQ(grown["sources"]["camera"], 60.0);
  EXPECT_EQ(grown["stages"]["process"], 30.0);
  EXPECT_EQ(grown["drops"]["color"], 3.0);
}

TEST(TopTable, ADaemonThatBeganAnewHasNoRatesYet) {
  EXPECT_EQ(rates(at(10, 300, 600), at(1, 5, 10))["frames_hz"], 0.0);
  json other = at(12, 360, 720);
  other["pid"] = 43;
  EXPECT_EQ(rates(at(10, 300, 600), other)["sources"]["camera"], 0.0);
  // A recording that begins again counts anew.
  EXPECT_EQ(rates(at(10, 300, 600), at(12, 5, 10))["frames_hz"], 0.0);
}

TEST(TopTable, ShowsSensorsAndTheStagesThatRan) {
  const json now = at(12, 360, 720);
  const std::vector<std::string> lines = top_lines(now, rates(at(10, 300, 600), now));
  EXPECT_THAT(lines.front(), HasSubstr("geoflowd 1.2.3, process 42"));
  EXPECT_THAT(lines, Contains("TRACKING 30 Hz"));
  EXPECT_THAT(lines, Contains(MatchesRegex("camera +streaming +60\\.0 +720 +1 +0 +")));
  EXPECT_THAT(lines, Contains(MatchesRegex("process +30\\.0 +12\\.50 +12\\.00 +20\\.00 +31\\.00")));
  EXPECT_THAT(lines, Not(Contains(HasSubstr("gicp"))));
}

}  // namespace
}  // namespace geoflow::tools
