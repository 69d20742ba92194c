#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/time.hpp"

#include "map/map_cloud.hpp"
#include "stream/frame_ring.hpp"
#include "stream/frame_streams.hpp"

namespace geoflow::daemon {
namespace {

constexpr std::uint32_t kBoth = GEOFLOW_WANT_COLOR | GEOFLOW_WANT_DEPTH;

/// A ring as another process sees it.
class Mapped {
 public:
  explicit Mapped(int fd) {
    struct stat status{};
    EXPECT_EQ(::fstat(fd, &status), 0);
    bytes_ = static_cast<std::size_t>(status.st_size);
    memory_ = ::mmap(nullptr, bytes_, PROT_READ, MAP_SHARED, fd, 0);
    EXPECT_NE(memory_, MAP_FAILED);
  }
  Mapped(const Mapped&) = delete;
  Mapped& operator=(const Mapped&) = delete;
  ~Mapped() { ::munmap(memory_, bytes_); }

  [[nodiscard]] std::uint64_t generation(std::size_t offset) const {
    std::uint64_t value = 0;
    std::memcpy(&value, static_cast<const std::byte*>(memory_) + offset, sizeof value);
    return value;
  }
  [[nodiscard]] std::byte pixel(std::size_t offset) const {
    return static_cast<const std::byte*>(memory_)[offset + sizeof(geoflow_slot)];
  }

 private:
  void* memory_ = nullptr;
  std::size_t bytes_ = 0;
};

std::vector<std::byte> filled(std::size_t size, int value) {
  return std::vector<std::byte>(size, static_cast<std::byte>(value));
}

TEST(FrameRing, NobodyElseCanWriteOrResizeIt) {
  auto ring = FrameRing::create("test", 2, 1000);
  ASSERT_TRUE(ring) << ring.error().message;
  (void)ring->write(filled(1000, 1));
  const int fd = ring->fd();
  EXPECT_EQ(::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0), MAP_FAILED);
  EXPECT_EQ(errno, EPERM);
  EXPECT_EQ(::pwrite(fd, "x", 1, 0), -1);
  EXPECT_EQ(errno, EPERM);
  EXPECT_EQ(::ftruncate(fd, 0), -1);
  EXPECT_EQ(::ftruncate(fd, 1 << 20), -1);
  EXPECT_EQ(::fcntl(fd, F_ADD_SEALS, F_SEAL_WRITE), -1);
}

TEST(FrameRing, AFrameIsThereUntilItsSlotIsWrittenAgainAndAReaderSeesThat) {
  auto ring = FrameRing::create("test", 3, 5000);
  ASSERT_TRUE(ring) << ring.error().message;
  EXPECT_GE(ring->frame_bytes(), 5000U);
  EXPECT_EQ(ring->slot_bytes() % 4096, 0U);
  const Mapped reader{ring->fd()};
  const FrameRing::Place first = ring->write(filled(5000, 1));
  EXPECT_EQ(reader.generation(first.slot * ring->slot_bytes()), first.generation);
  EXPECT_EQ(reader.pixel(first.slot * ring->slot_bytes()), std::byte{1});
  const FrameRing::Place second = ring->write(filled(10, 2));
  EXPECT_NE(second.slot, first.slot);
  (void)ring->write(filled(10, 3));
  EXPECT_EQ(reader.generation(first.slot * ring->slot_bytes()), first.generation);
  const FrameRing::Place fourth = ring->write(filled(10, 4));
  EXPECT_EQ(fourth.slot, first.slot);
  EXPECT_GT(reader.generation(first.slot * ring->slot_bytes()), first.generation);
  EXPECT_EQ(fourth.generation % 2, 0U);
}

class FrameStreamsTest : public testing::Test {
 protected:
  void SetUp() override {
    calibration_.camera = {.width = 6, .height = 4, .fx = 1, .fy = 2, .cx = 3, .cy = 4};
    calibration_.depth_unit_m = 0.002;
  }
  FrameRef image(int width, PixelFormat format, int value) {
    FrameRef frame = pool_.acquire({.width = width, .height = 4, .format = format});
    std::ranges::fill(frame.writable_bytes(), static_cast<std::byte>(value));
    return frame;
  }
  Images images(int width) {
    return {.color = image(width, PixelFormat::kGray8, 7),
            .depth = image(width, PixelFormat::kDepth16, 9),
            .depth_offset = Duration{5},
            .t_capture_ns = 1000,
            .t_recording_ns = 2000,
            .frame = 42};
  }

  FramePool pool_{8};
  Calibration calibration_;
  FrameStreams streams_;
};

TEST_F(FrameStreamsTest, GivesTheImagesThatAreWantedWithTheirCamera) {
  EXPECT_TRUE(streams_.publish(images(6), calibration_, 0).empty());
  const auto frames = streams_.publish(images(6), calibration_, kBoth);
  ASSERT_EQ(frames.size(), 2U);
  const geoflow_frame& color = frames[0].frame;
  const geoflow_frame& depth = frames[1].frame;
  EXPECT_EQ(color.stream, GEOFLOW_COLOR + 0U);
  EXPECT_EQ(color.format, GEOFLOW_GRAY8 + 0U);
  EXPECT_EQ(color.bytes, 24U);
  EXPECT_EQ(color.t_capture_ns, 1000);
  EXPECT_EQ(color.frame, 42U);
  EXPECT_EQ(depth.format, GEOFLOW_DEPTH16 + 0U);
  EXPECT_EQ(depth.stride, 12U);
  EXPECT_EQ(depth.bytes, 48U);
  EXPECT_EQ(depth.t_capture_ns, 1005);
  EXPECT_EQ(depth.t_recording_ns, 2005);
  EXPECT_EQ(frames[1].ring.unit_m, 0.002);
  EXPECT_EQ(frames[1].ring.intrinsics[3], 4.0);
  EXPECT_NE(frames[0].ring.ring, frames[1].ring.ring);
  const Mapped reader{frames[1].fd};
  EXPECT_EQ(reader.pixel(depth.slot * frames[1].ring.slot_bytes), std::byte{9});
}

TEST_F(FrameStreamsTest, WhatIsNotThereIsLeftOut) {
  Images only_depth = images(6);
  only_depth.color = {};
  const auto frames = streams_.publish(only_depth, calibration_, kBoth);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].frame.stream, GEOFLOW_DEPTH + 0U);
}

TEST_F(FrameStreamsTest, ARingIsKeptUntilALargerImageNeedsAnother) {
  const auto number = [&](int width) {
    return streams_.publish(images(width), calibration_, GEOFLOW_WANT_COLOR).front().ring.ring;
  };
  const std::uint64_t first = number(6);
  EXPECT_TRUE(streams_.publish(images(6), calibration_, 0).empty());  // all have gone
  EXPECT_EQ(number(6), first);
  EXPECT_EQ(number(3), first);
  EXPECT_NE(number(6000), first);
}

TEST_F(FrameStreamsTest, CloudsOfAnySizeAreInOneRing) {
  const auto small = streams_.publish(MapCloud(10));
  const auto large = streams_.publish(MapCloud(kMostCloudPoints));
  ASSERT_TRUE(small && large);
  EXPECT_EQ(small->frame.stream, GEOFLOW_CLOUD + 0U);
  EXPECT_EQ(small->frame.format, GEOFLOW_POINTS + 0U);
  EXPECT_EQ(small->frame.width, 10U);
  EXPECT_EQ(small->frame.height, 1U);
  EXPECT_EQ(small->frame.stride, 28U);
  EXPECT_EQ(small->frame.bytes, 280U);
  EXPECT_EQ(large->ring.ring, small->ring.ring);
  EXPECT_EQ(large->frame.frame, small->frame.frame + 1);
}

}  // namespace
}  // namespace geoflow::daemon
