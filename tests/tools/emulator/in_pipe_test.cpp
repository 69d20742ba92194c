#include "geoflow/tools/emulator/in_pipe.hpp"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {
namespace {

/// Says what it was told to say, in order, then nothing.
class ScriptedDevice final : public UsbDevice {
 public:
  std::deque<InTransfer> script;

  [[nodiscard]] UsbSpeed speed() const override { return UsbSpeed::kSuper; }
  [[nodiscard]] std::optional<Bytes> control(const SetupPacket& /*setup*/,
                                             std::span<const std::byte> /*out*/,
                                             HostTime /*now*/) override {
    return std::nullopt;
  }
  [[nodiscard]] InTransfer next_in(std::uint8_t /*endpoint*/, HostTime /*now*/) override {
    if (script.empty()) {
      return {};
    }
    InTransfer next = std::move(script.front());
    script.pop_front();
    return next;
  }
  [[nodiscard]] HostTime next_due(std::uint8_t /*endpoint*/, HostTime /*now*/) override {
    return HostTime::max();
  }
  [[nodiscard]] bool connected(HostTime /*now*/) override { return true; }
  void reset(HostTime /*now*/) override { script.clear(); }
};

Bytes counting(std::size_t size) {
  std::vector<std::uint8_t> values(size);
  std::iota(values.begin(), values.end(), std::uint8_t{0});
  const auto bytes = std::as_bytes(std::span{values});
  return {bytes.begin(), bytes.end()};
}

struct InPipeTest : testing::Test {
  ScriptedDevice device;
  InPipe pipe{device, 0x82};

  void say(Bytes data) { device.script.push_back({InStatus::kData, std::move(data)}); }
  InTransfer read(std::size_t length) { return pipe.read(length, HostTime{}); }
};

TEST_F(InPipeTest, CutsATransferToTheRequestsAndEndsItByAShortOne) {
  const Bytes whole = counting(20);
  say(whole);
  Bytes joined;
  for (const std::size_t expected : {8U, 8U, 4U}) {
    const InTransfer piece = read(8);
    EXPECT_EQ(piece.status, InStatus::kData);
    EXPECT_EQ(piece.data.size(), expected);
    joined.insert(joined.end(), piece.data.begin(), piece.data.end());
  }
  EXPECT_EQ(joined, whole);
  EXPECT_EQ(read(8).status, InStatus::kNothing);
}

TEST_F(InPipeTest, ATransferThatFillsItsLastRequestIsEndedByAnEmptyPacket) {
  say(counting(16));
  say(counting(3));
  EXPECT_EQ(read(8).data.size(), 8U);
  EXPECT_EQ(read(8).data.size(), 8U);
  const InTransfer end = read(8);
  EXPECT_EQ(end.status, InStatus::kData);
  EXPECT_TRUE(end.data.empty());
  EXPECT_EQ(read(8).data, counting(3));
}

TEST_F(InPipeTest, ClearingForgetsTheRestOfATransfer) {
  say(counting(20));
  say(counting(5));
  EXPECT_EQ(read(8).data.size(), 8U);
  pipe.clear();
  EXPECT_EQ(read(8).data, counting(5));
}

TEST_F(InPipeTest, StallAndSilenceReachTheHost) {
  device.script.push_back({InStatus::kStall, {}});
  EXPECT_EQ(read(8).status, InStatus::kStall);
  EXPECT_EQ(read(8).status, InStatus::kNothing);
  say(counting(2));
  EXPECT_EQ(read(8).data, counting(2));
}

}  // namespace
}  // namespace geoflow::emulator
