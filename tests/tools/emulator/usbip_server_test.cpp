#include "geoflow/tools/emulator/usbip_server.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "device_fixture.hpp"
#include "scripted_world.hpp"
#include "src/vhci.hpp"

namespace geoflow::emulator {
namespace {

constexpr Duration kMillisecond{1'000'000};

/// Bytes of a message, most significant first.
class Message {
 public:
  Message& u16(unsigned value) {
    bytes_.push_back(static_cast<std::byte>(value >> 8U));
    bytes_.push_back(static_cast<std::byte>(value));
    return *this;
  }
  Message& u32(std::uint32_t value) { return u16(value >> 16U).u16(value & 0xffffU); }
  Message& raw(std::span<const std::byte> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  Message& zeros(std::size_t count) {
    bytes_.resize(bytes_.size() + count);
    return *this;
  }
  [[nodiscard]] const Bytes& bytes() const noexcept { return bytes_; }

 private:
  Bytes bytes_;
};

std::uint32_t big_endian(const Bytes& bytes, std::size_t offset, std::size_t size = 4) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i) {
    value = (value << 8U) | std::to_integer<std::uint32_t>(bytes.at(offset + i));
  }
  return value;
}

/// A host's end of a connection; the server runs while it waits.
class Host {
 public:
  Host(UsbIpServer& server) : server_{server}, fd_{socket(AF_INET, SOCK_STREAM, 0)} {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(server.port());
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const void* any = &address;
    EXPECT_EQ(connect(fd_.get(), static_cast<const sockaddr*>(any), sizeof address), 0);
  }

  void send(const Message& message) {
    EXPECT_EQ(::send(fd_.get(), message.bytes().data(), message.bytes().size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(message.bytes().size()));
  }
  /// The next `size` bytes; fewer where the server closed the connection or 5 s went by.
  Bytes receive(std::size_t size) {
    Bytes bytes;
    const HostTime end = HostClock::now() + 5000 * kMillisecond;
    while (bytes.size() < size && HostClock::now() < end) {
      EXPECT_TRUE(server_.serve(kMillisecond));
      Bytes piece(size - bytes.size());
      const ssize_t count = recv(fd_.get(), piece.data(), piece.size(), MSG_DONTWAIT);
      if (count == 0 || (count < 0 && errno != EAGAIN)) {
        break;
      }
      bytes.insert(bytes.end(), piece.begin(), piece.begin() + std::max<ssize_t>(count, 0));
    }
    return bytes;
  }
  /// Attaches the device: whether it was given.
  bool import() {
    send(Message{}.u16(0x0111).u16(0x8003).u32(0).raw(bus_id()));
    const Bytes header = receive(8);
    if (header.size() != 8 || big_endian(header, 4) != 0) {
      return false;
    }
    description_ = receive(312);
    return description_.size() == 312;
  }
  [[nodiscard]] const Bytes& description() const noexcept { return description_; }

  /// A request of an IN endpoint, or of endpoint 0 with its setup packet and data.
  std::uint32_t submit(std::uint32_t endpoint, bool in, std::uint32_t length,
                       const Bytes& setup = Bytes(8), const Bytes& out = {}) {
    send(Message{}
             .u32(1)
             .u32(++sequence_)
             .u32(0x10002)
             .u32(in ? 1 : 0)
             .u32(endpoint)
             .u32(0)
             .u32(length)
             .u32(0)
             .u32(0xffffffff)
             .u32(0)
             .raw(setup)
             .raw(out));
    return sequence_;
  }
  struct Reply {
    std::uint32_t command = 0;
    std::uint32_t sequence = 0;
    std::int32_t status = 0;
    Bytes data{};
  };
  /// The next message from the device. `in`: data follows it.
  Reply reply(bool in = true) {
    const Bytes header = receive(48);
    if (header.size() < 48) {
      ADD_FAILURE() << "no reply";
      return {};
    }
    Reply reply{.command = big_endian(header, 0),
                .sequence = big_endian(header, 4),
                .status = static_cast<std::int32_t>(big_endian(header, 20))};
    if (in && reply.command == 3) {
      reply.data = receive(big_endian(header, 24));
    }
    return reply;
  }
  Reply control(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                std::uint16_t length, const Bytes& out = {}) {
    const Bytes setup =
        ByteWriter{}.put(type).put(request).put(value).put(index).put(length).take();
    submit(0, (type & 0x80U) != 0, length, setup, out);
    return reply((type & 0x80U) != 0);
  }
  void unlink(std::uint32_t sequence) {
    send(Message{}.u32(2).u32(++sequence_).u32(0x10002).u32(0).u32(0).u32(sequence).zeros(24));
  }

  static Bytes bus_id() {
    Bytes bytes = ByteWriter{}.text(UsbIpServer::kBusId).take();
    bytes.resize(32);
    return bytes;
  }

 private:
  UsbIpServer& server_;
  UniqueFd fd_;
  Bytes description_;
  std::uint32_t sequence_ = 0;
};

struct UsbIpServerTest : DeviceTest {
  std::unique_ptr<UsbIpServer> server;

  void serve() {
    plug();
    auto listening = UsbIpServer::listen(*camera, 0);
    ASSERT_TRUE(listening) << listening.error().message;
    server = std::move(*listening);
  }
};

TEST_F(UsbIpServerTest, ListsTheCameraWithItsInterfaces) {
  serve();
  Host host{*server};
  host.send(Message{}.u16(0x0111).u16(0x8005).u32(0));
  const Bytes reply = host.receive(12 + 312 + 6 * 4);
  ASSERT_EQ(reply.size(), 12U + 312 + 24);
  EXPECT_EQ(big_endian(reply, 0), 0x01110005U);
  EXPECT_EQ(big_endian(reply, 8), 1U);
  EXPECT_EQ(big_endian(reply, 12 + 296), 5U) << "SuperSpeed";
  EXPECT_EQ(big_endian(reply, 12 + 300), 0x80860b3aU);
  EXPECT_EQ(big_endian(reply, 12 + 312), 0x0e010000U);
  EXPECT_EQ(big_endian(reply, 12 + 312 + 20), 0x03000000U);
}

TEST_F(UsbIpServerTest, OneHostHasTheCameraAndOthersAreRefused) {
  serve();
  Host first{*server};
  ASSERT_TRUE(first.import());
  EXPECT_TRUE(server->attached());
  EXPECT_EQ(big_endian(first.description(), 300), 0x80860b3aU);
  Host second{*server};
  EXPECT_FALSE(second.import());
}

TEST_F(UsbIpServerTest, CarriesControlTransfersAndStalls) {
  serve();
  Host host{*server};
  ASSERT_TRUE(host.import());
  const auto device = host.control(0x80, 6, 0x0100, 0, 64);
  EXPECT_EQ(device.status, 0);
  EXPECT_EQ(device.data.size(), 18U);
  EXPECT_EQ(host.control(0x80, 6, 0x0200, 0, 9).data.size(), 9U);
  EXPECT_EQ(host.control(0x80, 6, 0x0200, 0, 4096).data.size(), 3199U);
  EXPECT_EQ(host.control(0x00, 9, 1, 0, 0).status, 0);
  EXPECT_EQ(host.control(0x80, 6, 0x0600, 0, 10).status, -EPIPE);
  EXPECT_EQ(host.control(0xc0, 0x20, 0, 7, 10).status, -EPIPE);
}

TEST_F(UsbIpServerTest, StreamsAFrameToRequestsThatAreSmallerThanIt) {
  for (std::uint8_t i = 0; i < 3; ++i) {
    world->add_images(i, i * Duration{33'333'333});
  }
  serve();
  Host host{*server};
  ASSERT_TRUE(host.import());
  const Bytes block = ByteWriter{}.u16(1).u8(1).u8(5).u32(333333).pad_to(48).take();
  ASSERT_EQ(host.control(0x21, 1, 0x0100, 1, 48, block).status, 0);
  ASSERT_EQ(host.control(0x21, 1, 0x0200, 1, 48, block).status, 0);
  constexpr std::uint32_t kRequest = 32768;
  for (int i = 0; i < 5; ++i) {
    host.submit(2, true, kRequest);
  }
  for (std::uint8_t number = 0; number < 3; ++number) {
    Bytes payload;
    Bytes piece;
    do {
      const auto reply = host.reply();
      ASSERT_EQ(reply.status, 0);
      piece = reply.data;
      payload.insert(payload.end(), piece.begin(), piece.end());
      host.submit(2, true, kRequest);
    } while (piece.size() == kRequest);
    ASSERT_EQ(payload.size(), 232U + 640 * 480 * 2);
    EXPECT_TRUE(
        std::ranges::equal(std::span{payload}.subspan(232), ScriptedWorld::pixels(number, 2)));
  }
}

TEST_F(UsbIpServerTest, ForgetsARequestThatIsUnlinked) {
  serve();
  Host host{*server};
  ASSERT_TRUE(host.import());
  const std::uint32_t request = host.submit(6, true, 64);
  host.unlink(request);
  auto reply = host.reply();
  EXPECT_EQ(reply.command, 4U);
  EXPECT_EQ(reply.status, -ECONNRESET);
  host.unlink(request);
  reply = host.reply();
  EXPECT_EQ(reply.status, 0) << "it is not there any more";
}

TEST_F(UsbIpServerTest, WhoDoesNotSpeakTheProtocolIsCutOffAndTheNextIsServed) {
  serve();
  for (const std::uint32_t command : {7U, 3U}) {
    Host host{*server};
    ASSERT_TRUE(host.import());
    host.send(Message{}.u32(command).zeros(44));
    EXPECT_TRUE(host.receive(1).empty());
    EXPECT_FALSE(server->attached());
  }
  Host isochronous{*server};
  ASSERT_TRUE(isochronous.import());
  isochronous.send(
      Message{}.u32(1).u32(1).u32(0).u32(1).u32(2).u32(0).u32(1024).u32(0).u32(8).u32(1).zeros(8));
  EXPECT_TRUE(isochronous.receive(1).empty());
  Host greedy{*server};
  ASSERT_TRUE(greedy.import());
  greedy.send(Message{}.u32(1).u32(1).u32(0).u32(0).u32(0).u32(0).u32(0x7fffffff).zeros(20));
  EXPECT_TRUE(greedy.receive(1).empty());
  Host stranger{*server};
  stranger.send(Message{}.u16(0x0106).u16(0x8005).u32(0));
  EXPECT_TRUE(stranger.receive(1).empty());
  Host good{*server};
  EXPECT_TRUE(good.import());
}

TEST_F(UsbIpServerTest, ACameraThatRestartsIsUnplugged) {
  serve();
  Host host{*server};
  ASSERT_TRUE(host.import());
  const Bytes restart = ByteWriter{}.u16(20).u16(0xcdab).u32(0x20).pad_to(1024).take();
  EXPECT_EQ(host.control(0x21, 1, 0x0100, 0x0300, 1024, restart).status, 0);
  EXPECT_TRUE(host.receive(1).empty());
  EXPECT_FALSE(server->attached());
}

TEST(Vhci, FindsAFreePortOfTheDevicesSpeed) {
  constexpr std::string_view kStatus =
      "hub port sta spd dev      sockfd local_busid\n"
      "hs  0000 004 000 00000000 000000 0-0\n"
      "hs  0001 004 000 00000000 000000 0-0\n"
      "ss  0008 006 005 00010002 000003 1-1\n"
      "ss  0009 004 000 00000000 000000 0-0\n";
  EXPECT_EQ(usbip::free_port(kStatus, UsbSpeed::kSuper).value_or(-1), 9);
  EXPECT_EQ(usbip::free_port(kStatus, UsbSpeed::kHigh).value_or(-1), 0);
  EXPECT_FALSE(usbip::free_port("hub port sta spd dev\n", UsbSpeed::kSuper));
}

}  // namespace
}  // namespace geoflow::emulator
