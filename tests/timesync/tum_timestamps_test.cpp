#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/counters.hpp"
#include "geoflow/timesync/synchroniser.hpp"
#include "tests/support/data.hpp"

#include "scripted_streams.hpp"

/// The real colour and depth stamps of eleven TUM RGB-D sequences, in order of time, through the
/// synchroniser.
namespace geoflow::timesync::tests {
namespace {

struct Association {
  HostTime color;
  HostTime depth;
};

/// "seconds.microseconds", exactly.
HostTime parse_stamp(const std::string& text) {
  constexpr std::int64_t kNsPerSecond = 1'000'000'000;
  constexpr std::int64_t kNsPerMicrosecond = 1000;
  const std::size_t point = text.find('.');
  return HostTime{Duration{std::stoll(text.substr(0, point)) * kNsPerSecond +
                           std::stoll(text.substr(point + 1)) * kNsPerMicrosecond}};
}

std::vector<Association> read_associations(const std::filesystem::path& path) {
  std::ifstream file{path};
  std::vector<Association> associations;
  std::string color;
  std::string color_file;
  std::string depth;
  std::string depth_file;
  while (file >> color >> color_file >> depth >> depth_file) {
    associations.push_back({parse_stamp(color), parse_stamp(depth)});
  }
  return associations;
}

template <typename Sample>
Arrival<CameraClock, Sample> at(HostTime t) {
  return {DeviceTime<CameraClock>{t.time_since_epoch()}, t, Sample{tiny_frame()}};
}

std::vector<SyncedPacket> synchronise(Synchroniser& sync, const std::vector<Association>& list) {
  std::vector<SyncedPacket> packets;
  const auto pop = [&](HostTime now) {
    while (auto packet = sync.pop(now)) {
      packets.push_back(*packet);
      packets.back().color = {};  // the pool is small
      packets.back().depth = {};
    }
  };
  std::size_t next_color = 0;
  std::size_t next_depth = 0;
  while (next_color < list.size() || next_depth < list.size()) {
    const bool is_color =
        next_depth == list.size() ||
        (next_color < list.size() && list[next_color].color <= list[next_depth].depth);
    const HostTime t = is_color ? list[next_color++].color : list[next_depth++].depth;
    is_color ? sync.push_color(at<ColorFrame>(t)) : sync.push_depth(at<DepthFrame>(t));
    pop(t);
  }
  while (auto packet = sync.flush()) {
    packets.push_back(*packet);
  }
  return packets;
}

/// Distance of the depth frame that is nearest to `t`.
Duration nearest_distance(const std::vector<Association>& list, HostTime t) {
  Duration best = Duration::max();
  for (const Association& one : list) {
    best = std::min<Duration>(best, std::chrono::abs(one.depth - t));
  }
  return best;
}

TEST(TumTimestamps, EveryColourFrameGetsADepthFrameAsNearAsTheLists) {
  GEOFLOW_DATA_OR_SKIP(folder, "tum-timestamps");
  std::size_t total = 0;
  std::size_t as_listed = 0;
  std::size_t nearest = 0;
  std::uint64_t shared = 0;
  for (const auto& entry : std::filesystem::directory_iterator{folder}) {
    const auto list = read_associations(entry.path());
    ASSERT_FALSE(list.empty()) << entry.path();
    Synchroniser sync{{}, {}};
    const auto packets = synchronise(sync, list);
    ASSERT_EQ(packets.size(), list.size()) << entry.path();
    std::int64_t sum_ns = 0;
    std::int64_t listed_sum_ns = 0;
    for (std::size_t i = 0; i < list.size(); ++i) {
      EXPECT_EQ(packets[i].t, list[i].color);
      as_listed += packets[i].depth_offset == list[i].depth - list[i].color ? 1U : 0U;
      nearest += std::chrono::abs(packets[i].depth_offset) == nearest_distance(list, packets[i].t)
                     ? 1U
                     : 0U;
      sum_ns += std::chrono::abs(packets[i].depth_offset).count();
      listed_sum_ns += std::chrono::abs(list[i].depth - list[i].color).count();
    }
    total += list.size();
    const SynchroniserCounters& counters = sync.counters();
    EXPECT_EQ(counters.depth_missing, 0U) << entry.path();
    EXPECT_EQ(counters.wait_expired, 0U) << entry.path();
    EXPECT_EQ(counters.color.pushed, counters.color.used) << entry.path();
    EXPECT_LE(sum_ns, listed_sum_ns) << entry.path() << ": farther than the lists on average";
    shared += counters.depth_shared;
  }
  RecordProperty("frames", std::to_string(total));
  RecordProperty("as_listed", std::to_string(as_listed));
  RecordProperty("nearest", std::to_string(nearest));
  RecordProperty("shared", std::to_string(shared));
  constexpr double kAlmostAll =
      0.995;  // the lists pair the globally nearest first, and no frame twice
  EXPECT_GE(static_cast<double>(as_listed), kAlmostAll * static_cast<double>(total));
  EXPECT_GE(static_cast<double>(nearest), kAlmostAll * static_cast<double>(total));
  EXPECT_LE(static_cast<double>(shared), (1.0 - kAlmostAll) * static_cast<double>(total));
}

}  // namespace
}  // namespace geoflow::timesync::tests
