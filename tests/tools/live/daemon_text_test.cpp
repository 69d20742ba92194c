#include "geoflow/tools/daemon_text.hpp"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace geoflow::tools {
namespace {

using nlohmann::json;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

json status() {
  return json::parse(R"({
    "version": "1.2.3", "pid": 42, "uptime_s": 250.5, "summary": "TRACKING 30 Hz; camera ok",
    "source": {"path": "", "format": "d435i", "open": true, "trouble": "", "calibration": "the camera's"},
    "frames": 200, "tracked": 199, "rejected": 1,
    "drops": {"color": 2, "depth": 3, "samples": 4, "packets": 5},
    "times_ms": {"arrival_to_pose": {"count": 200, "p50": 41.0, "p99": 62.0}},
    "map": {"file": "/m/map", "saved_s": 12.0, "keyframes": 7, "bytes": 1572864, "trouble": ""},
    "pose_socket": {"clients": [{"name": "planner", "pid": 7}], "refused": 0, "cut_off": 1},
    "control_clients": 1, "peak_memory_mib": 123.4})");
}

TEST(DaemonText, SaysAllInWords) {
  EXPECT_THAT(
      daemon_lines(status()),
      ElementsAre("geoflowd 1.2.3, process 42, up 4 min", "state    TRACKING 30 Hz; camera ok",
                  "source   d435i, calibration: the camera's",
                  "frames   200, with a pose 199 (99.5 %); dropped: colour 2, depth 3, samples 4, "
                  "packets 5; rejected 1",
                  "latency  from a frame's arrival to its pose 41 ms, 99 % within 62 ms",
                  "map      /m/map, saved 12 s ago: 7 keyframes, 1.5 MiB",
                  "clients  poses: 1: planner (7); control: 1; refused 0, cut off 1",
                  "memory   123 MiB at most"));
}

TEST(DaemonText, SaysWhatIsWrong) {
  json wrong = status();
  wrong["source"]["trouble"] = "no D435i is connected";
  wrong["map"]["saved_s"] = nullptr;
  wrong["map"]["trouble"] = "No space left on device";
  const std::vector<std::string> lines = daemon_lines(wrong);
  EXPECT_THAT(lines, Contains("source   d435i, not open: no D435i is connected"));
  EXPECT_THAT(lines, Contains("map      /m/map, not saved yet; not saved the last time: No space "
                              "left on device"));
}

TEST(DaemonText, AnotherVersionsStatusIsNoFault) {
  EXPECT_THAT(daemon_lines(json::object()).front(), HasSubstr("geoflowd"));
  EXPECT_THAT(daemon_lines(json::parse(R"({"map": 3, "pid": "x", "pose_socket": []})")),
              Contains("map      not kept: no map.file is configured"));
}

TEST(DaemonText, BytesHaveUnits) {
  EXPECT_EQ(bytes_in_words(0), "0 B");
  EXPECT_EQ(bytes_in_words(1023), "1023 B");
  EXPECT_EQ(bytes_in_words(1536), "1.5 KiB");
  EXPECT_EQ(bytes_in_words(5ULL << 40U), "5120.0 GiB");
}

}  // namespace
}  // namespace geoflow::tools
