#include "geoflow/timesync/packet_queue.hpp"

#include <cstddef>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/timesync/synchroniser.hpp"

#include "scripted_streams.hpp"

namespace geoflow::timesync::tests {
namespace {

constexpr double kImuMs = 5;
constexpr double kLegsMs = 2;
constexpr std::size_t kPlenty = 16384;  // more than any walk here has samples of a kind

SynchroniserStreams all_streams() {
  return {.camera = {}, .imu = StampInfo{}, .legs = StampInfo{}};
}

/// What the synchroniser makes of a walk with all sensors.
std::vector<SyncedPacket> packets_of(double duration_ms) {
  Synchroniser synchroniser{{}, all_streams()};
  std::vector<SyncedPacket> packets;
  for (double t_ms = 1000; t_ms < 1000 + duration_ms; ++t_ms) {
    const auto each = [&](double every_ms) {
      return static_cast<int>(t_ms) % static_cast<int>(every_ms) == 0;
    };
    if (each(kLegsMs)) {
      synchroniser.push_legs(legs(t_ms));
    }
    if (each(kImuMs)) {
      synchroniser.push_imu(imu(t_ms));
      synchroniser.push_body_velocity(body_velocity(t_ms));
    }
    if (each(33)) {
      synchroniser.push_depth(depth(t_ms));
      synchroniser.push_color(color(t_ms));
    }
    for (SyncedPacket& packet : pop_all(synchroniser, t_ms)) {
      packets.push_back(std::move(packet));
    }
  }
  return packets;
}

/// That samples cover all from the packet before to this one, in order and none twice.
template <typename Sample>
void expect_whole(const std::vector<Timed<Sample>>& samples, const SyncedPacket& before,
                  const SyncedPacket& packet, double every_ms) {
  ASSERT_FALSE(samples.empty());
  EXPECT_LE(samples.front().t, before.t);
  EXPECT_GE(samples.back().t, packet.t);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    EXPECT_EQ(to_ms(samples[i].t - samples[i - 1].t), every_ms);
  }
}

void expect_whole(const SyncedPacket& before, const SyncedPacket& packet) {
  ASSERT_GT(packet.sequence, before.sequence);
  expect_whole(packet.imu, before, packet, kImuMs);
  expect_whole(packet.legs, before, packet, kLegsMs);
  expect_whole(packet.body_velocity, before, packet, kImuMs);
}

TEST(PacketQueue, GivesWhatWasPushedInOrder) {
  PacketQueue queue{3, kPlenty};
  EXPECT_FALSE(queue.try_pop());
  for (const SyncedPacket& packet : packets_of(100)) {
    queue.push(packet);
  }
  EXPECT_EQ(queue.dropped(), 0U);
  EXPECT_EQ(queue.try_pop()->sequence, 0U);
  EXPECT_EQ(queue.try_pop()->sequence, 1U);
}

TEST(PacketQueue, ADroppedPacketsSamplesAreInTheOneAfterIt) {
  const std::vector<SyncedPacket> packets = packets_of(2000);
  ASSERT_GT(packets.size(), 50U);
  for (const std::size_t capacity : {1U, 2U, 4U}) {
    PacketQueue queue{capacity, kPlenty};
    std::mt19937 random{7};  // NOLINT(cert-msc51-cpp): the same every time
    std::optional<SyncedPacket> before;
    std::size_t taken = 0;
    for (const SyncedPacket& packet : packets) {
      queue.push(packet);
      const bool busy = std::uniform_int_distribution{0, 9}(random) < 7;
      if (auto popped = busy ? std::nullopt : queue.try_pop()) {
        if (before) {
          expect_whole(*before, *popped);
        }
        EXPECT_TRUE(popped->color);
        before = std::move(popped);
        ++taken;
      }
    }
    EXPECT_GT(queue.dropped(), 10U);
    EXPECT_GE(taken + queue.dropped() + capacity, packets.size());
    EXPECT_LE(taken + queue.dropped(), packets.size());
  }
}

TEST(PacketQueue, SamplesOfAPacketAreBoundedTheNewestStay) {
  const std::vector<SyncedPacket> packets = packets_of(2000);
  PacketQueue queue{1, 100};
  for (const SyncedPacket& packet : packets) {
    queue.push(packet);
  }
  const auto last = queue.try_pop();
  ASSERT_TRUE(last);
  EXPECT_EQ(last->sequence, packets.back().sequence);
  EXPECT_EQ(last->legs.size(), 100U);
  EXPECT_EQ(last->legs.back().t, packets.back().legs.back().t);
}

TEST(PacketQueue, AnAbsentSensorStaysAbsent) {
  PacketQueue queue{1, kPlenty};
  std::vector<SyncedPacket> packets = packets_of(200);
  packets[1].legs.clear();
  packets[2].imu.clear();
  queue.push(packets[1]);
  queue.push(packets[2]);
  const auto taken = queue.try_pop();
  ASSERT_TRUE(taken);
  EXPECT_EQ(times_ms(taken->legs), times_ms(packets[2].legs));
  EXPECT_EQ(times_ms(taken->imu), times_ms(packets[1].imu));
}

TEST(PacketQueue, NothingIsMissingBetweenTwoThreads) {
  const std::vector<SyncedPacket> packets = packets_of(20'000);
  PacketQueue queue{2, kPlenty};
  const std::jthread producer{[&] {
    for (const SyncedPacket& packet : packets) {
      queue.push(packet);
    }
  }};
  std::optional<SyncedPacket> before;
  while (!before || before->sequence != packets.back().sequence) {
    if (auto popped = queue.try_pop()) {
      if (before) {
        expect_whole(*before, *popped);
      }
      before = std::move(popped);
    }
  }
}

}  // namespace
}  // namespace geoflow::timesync::tests
