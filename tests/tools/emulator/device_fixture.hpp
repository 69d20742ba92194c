#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include <gtest/gtest.h>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "scripted_world.hpp"

namespace geoflow::emulator {

/// Little-endian fields of bytes.
template <typename Integer>
Integer field(std::span<const std::byte> bytes, std::size_t offset) {
  std::uint64_t value = 0;
  for (std::size_t i = sizeof(Integer); i-- > 0;) {
    value = (value << 8U) | std::to_integer<std::uint64_t>(bytes[offset + i]);
  }
  return static_cast<Integer>(value);
}

inline Bytes bytes_of(std::initializer_list<unsigned> values) {
  Bytes bytes;
  for (const unsigned value : values) {
    bytes.push_back(static_cast<std::byte>(value));
  }
  return bytes;
}

/// A camera before a scripted world, and the requests that drivers make of it.
struct DeviceTest : testing::Test {
  std::unique_ptr<ScriptedWorld> world = std::make_unique<ScriptedWorld>();
  std::unique_ptr<D435i> camera;
  HostTime now{Duration{50'000'000'000}};

  void plug(const D435iOptions& options = {}) {
    auto created = D435i::create(options, std::move(world));
    ASSERT_TRUE(created) << created.error().message;
    camera = std::move(*created);
  }

  std::optional<Bytes> get(std::uint8_t type, std::uint8_t request, std::uint16_t value,
                           std::uint16_t index, std::uint16_t length) {
    return camera->control({type, request, value, index, length}, {}, now);
  }
  bool set(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
           const Bytes& data) {
    const auto length = static_cast<std::uint16_t>(data.size());
    return camera->control({type, request, value, index, length}, data, now).has_value();
  }
  Bytes descriptor(std::uint16_t value) { return get(0x80, 6, value, 0, 0xffff).value_or(Bytes{}); }

  /// Negotiates and commits a format of a streaming interface. Interval [100 ns].
  bool commit(std::uint8_t interface, std::uint8_t format, std::uint8_t frame,
              std::uint32_t interval) {
    const Bytes block = ByteWriter{}.u16(1).put(format).put(frame).put(interval).pad_to(48).take();
    return set(0x21, 0x01, 0x0100, interface, block) && set(0x21, 0x01, 0x0200, interface, block);
  }

  /// A request of the hardware monitor; its reply, 1024 bytes.
  Bytes monitor(std::uint32_t opcode, std::array<std::uint32_t, 4> parameters = {}) {
    ByteWriter request;
    request.u16(20).u16(0xcdab).put(opcode);
    for (const std::uint32_t parameter : parameters) {
      request.put(parameter);
    }
    EXPECT_TRUE(set(0x21, 0x01, 0x0100, 0x0300, request.pad_to(1024).take()));
    Bytes reply = get(0xa1, 0x81, 0x0100, 0x0300, 1024).value_or(Bytes{});
    EXPECT_EQ(reply.size(), 1024U);
    reply.resize(1024);
    return reply;
  }
  /// The data of such a reply; a failure where it is an error.
  Bytes monitor_data(std::uint32_t opcode, std::array<std::uint32_t, 4> parameters = {}) {
    const Bytes reply = monitor(opcode, parameters);
    EXPECT_EQ(field<std::uint32_t>(reply, 0), opcode);
    const auto length = field<std::uint32_t>(reply, 1020);
    EXPECT_LE(length, 1016U);
    return {reply.begin() + 4, reply.begin() + 4 + length};
  }

  /// Everything that an endpoint says until `duration` from now, asked each millisecond.
  std::vector<Bytes> fetch(std::uint8_t endpoint, Duration duration) {
    std::vector<Bytes> transfers;
    for (const HostTime end = now + duration; now < end; now += Duration{1'000'000}) {
      for (auto next = camera->next_in(endpoint, now); next.status == InStatus::kData;
           next = camera->next_in(endpoint, now)) {
        transfers.push_back(std::move(next.data));
      }
    }
    return transfers;
  }
};

}  // namespace geoflow::emulator
