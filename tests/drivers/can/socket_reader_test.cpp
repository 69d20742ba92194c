#include "can/socket_reader.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/can.h>
#include <sys/socket.h>
#include <sys/types.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "can/bus_fixture.hpp"
#include "can/channel.hpp"
#include "can/frame.hpp"
#include "can/socket_channel.hpp"

namespace geoflow::drivers::can {
namespace {

using testing::AnyOf;
using testing::HasSubstr;

/// Two ends of a socket of datagrams: it stands in for a CAN socket, whose reads look the same.
struct Wire {
  UniqueFd near;
  UniqueFd far;
  Wire() {
    std::array<int, 2> fds{};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, fds.data()), 0);
    near.reset(fds[0]);
    far.reset(fds[1]);
  }
  void send(std::span<const std::byte> bytes) const {
    EXPECT_EQ(::send(far.get(), bytes.data(), bytes.size(), 0), static_cast<ssize_t>(bytes.size()));
  }
};

TEST(KernelFrame, EveryKindGoesThereAndBack) {
  for (const std::string_view text :
       {"110#0CFE9411D8DC0701", "7FF#", "00000110#01", "123#R",
        "213##1000000002CCF00006A180000EFD8000000007800FF000000", "20000040#0000000000000000"}) {
    const Frame frame = tests::frame(text);
    const KernelFrame kernel = to_kernel(frame);
    EXPECT_EQ(kernel.size, frame.fd ? CANFD_MTU : CAN_MTU) << text;
    const auto back = from_kernel(kernel.view());
    ASSERT_TRUE(back) << text;
    EXPECT_EQ(*back, frame) << text;
  }
}

TEST(KernelFrame, TheLayoutIsTheKernels) {
  can_frame raw{};
  raw.can_id = 0x110;
  raw.can_dlc = 3;
  raw.data[2] = 0x5A;
  const auto frame = from_kernel(std::as_bytes(std::span{&raw, 1}));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->id, 0x110U);
  EXPECT_EQ(frame->length, 3U);
  EXPECT_EQ(frame->data[2], std::byte{0x5A});
  raw.can_dlc = 9;
  EXPECT_FALSE(from_kernel(std::as_bytes(std::span{&raw, 1})));
}

TEST(KernelFrame, FlagsThatAreTheKernelsOwnAreLeftOut) {
  constexpr std::uint8_t kKernelsOwn = 0x04;  // CANFD_FDF
  canfd_frame raw{};
  raw.can_id = 0x213;
  raw.len = 24;
  raw.flags = CANFD_BRS | kKernelsOwn;
  const auto frame = from_kernel(std::as_bytes(std::span{&raw, 1}));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->fd_flags, CANFD_BRS);
}

TEST(SocketReader, TakesAllThatWaitsInOrder) {
  const Wire wire;
  SocketReader reader;
  std::vector<Received> frames;
  ASSERT_TRUE(reader.read(wire.near.get(), 1, frames));
  EXPECT_TRUE(frames.empty());
  const HostTime before = HostClock::now();
  Frame frame = tests::frame("110#0CFE9411D8DC0701");
  constexpr int kFrames = 150;  // more than one system call takes
  for (int i = 0; i < kFrames; ++i) {
    frame.data[0] = static_cast<std::byte>(i);
    wire.send(to_kernel(frame).view());
  }
  ASSERT_TRUE(reader.read(wire.near.get(), 1, frames));
  ASSERT_EQ(frames.size(), static_cast<std::size_t>(kFrames));
  for (int i = 0; i < kFrames; ++i) {
    const Received& received = frames[static_cast<std::size_t>(i)];
    EXPECT_EQ(received.frame.data[0], static_cast<std::byte>(i));
    EXPECT_EQ(received.bus, 1);
    EXPECT_GE(received.t_arrival, before);
    EXPECT_LE(received.t_arrival, HostClock::now());
  }
}

TEST(SocketReader, WhatIsNoFrameIsCountedAndPassedOver) {
  const Wire wire;
  SocketReader reader;
  std::vector<Received> frames;
  const std::array<std::byte, 100> bytes{};
  wire.send(std::span{bytes}.first(15));
  wire.send(std::span{bytes}.first(17));
  wire.send(bytes);  // longer than any frame: cut off
  wire.send(to_kernel(tests::frame("110#00")).view());
  ASSERT_TRUE(reader.read(wire.near.get(), 0, frames));
  EXPECT_EQ(frames.size(), 1U);
  EXPECT_EQ(reader.malformed(), 3U);
  EXPECT_EQ(reader.overflowed(), 0U);
}

TEST(SocketReader, AnErrorOfTheSocketIsPassedOn) {
  SocketReader reader;
  std::vector<Received> frames;
  const auto read = reader.read(-1, 0, frames);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kUnavailable);
}

TEST(SocketChannel, TheWrongInterfaceIsSaidInWords) {
  const auto missing = open_can_socket("nocan7");
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().message,
              AnyOf(HasSubstr("nocan7: no such network interface; of those for CAN, there "),
                    HasSubstr("nocan7: this kernel has no CAN")));
  const auto loopback = open_can_socket("lo");
  ASSERT_FALSE(loopback);
  EXPECT_THAT(loopback.error().message, AnyOf(HasSubstr("lo: the wrong interface: not one for CAN"),
                                              HasSubstr("lo: this kernel has no CAN")));
}

TEST(SocketChannel, WakeEndsAWait) {
  auto channel = SocketChannel::create({"can0"}, {});
  ASSERT_TRUE(channel) << channel.error().message;
  (*channel)->wake();
  const HostTime before = HostClock::now();
  (*channel)->pause(std::chrono::seconds{30});
  EXPECT_LT(HostClock::now() - before, std::chrono::seconds{10});
}

}  // namespace
}  // namespace geoflow::drivers::can
