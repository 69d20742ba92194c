#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/fault.hpp"
#include "geoflow/tools/emulator/faulty_device.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "device_fixture.hpp"
#include "scripted_world.hpp"

namespace geoflow::emulator {
namespace {

constexpr Duration kFrame{33'333'333};
constexpr std::size_t kPayload = 232U + 640 * 480 * 2;

TEST(ParseFault, ReadsNameTimesAndStream) {
  const auto fault = parse_fault("silent@5.5+0.25:color");
  ASSERT_TRUE(fault) << fault.error().message;
  EXPECT_EQ(fault->fault, DeviceFault::kSilent);
  EXPECT_EQ(fault->start, Duration{5'500'000'000});
  EXPECT_EQ(fault->duration, Duration{250'000'000});
  EXPECT_EQ(fault->endpoint, 0x84);
  const auto plain = parse_fault("unplug@2");
  ASSERT_TRUE(plain);
  EXPECT_EQ(plain->duration, Duration{1'000'000'000});
  EXPECT_FALSE(plain->endpoint);
}

TEST(ParseFault, NamesWhatIsWrong) {
  for (const auto& [text, part] :
       {std::pair{"melt@1", "'melt'"}, std::pair{"stall", "''"}, std::pair{"stall@x", "'x'"},
        std::pair{"stall@-1", "'-1'"}, std::pair{"stall@1+nan", "'nan'"},
        std::pair{"stall@1:sonar", "'sonar'"}}) {
    const auto fault = parse_fault(text);
    ASSERT_FALSE(fault) << text;
    EXPECT_NE(fault.error().message.find(part), std::string::npos) << fault.error().message;
  }
}

/// A camera that streams depth, with one fault from 0.3 s after its first frame on.
struct FaultyDeviceTest : DeviceTest {
  std::unique_ptr<FaultyDevice> faulty;

  void stream(std::string_view fault) {
    for (std::uint8_t i = 0; i < 60; ++i) {
      world->add_images(i, i * kFrame);
    }
    plug();
    const auto parsed = parse_fault(fault);
    ASSERT_TRUE(parsed) << parsed.error().message;
    faulty = std::make_unique<FaultyDevice>(*camera, std::vector{*parsed});
    ASSERT_TRUE(commit(1, 1, 5, 333333));
  }
  /// What depth gives within `duration`, other than nothing.
  std::vector<InTransfer> run(Duration duration) {
    std::vector<InTransfer> transfers;
    for (const HostTime end = now + duration; now < end; now += Duration{5'000'000}) {
      if (auto next = faulty->next_in(0x82, now); next.status != InStatus::kNothing) {
        transfers.push_back(std::move(next));
      }
    }
    return transfers;
  }
  /// What it gives before the fault, which must be whole frames, and what while it is there.
  std::vector<InTransfer> run_into_fault() {
    const auto before = run(Duration{310'000'000});
    EXPECT_EQ(before.size(), 9U);
    for (const InTransfer& transfer : before) {
      EXPECT_EQ(transfer.data.size(), kPayload);
    }
    return run(Duration{190'000'000});
  }
};

TEST_F(FaultyDeviceTest, Unplugged) {
  stream("unplug@0.3+0.2");
  EXPECT_TRUE(run_into_fault().empty());
  EXPECT_FALSE(faulty->connected(now));
  const HostTime back = faulty->next_due(0x82, now);
  EXPECT_GT(back, now);
  now = back;
  EXPECT_TRUE(faulty->connected(now));
}

TEST_F(FaultyDeviceTest, StalledUntilItIsCleared) {
  stream("stall@0.3");
  const auto during = run_into_fault();
  ASSERT_FALSE(during.empty());
  EXPECT_EQ(during.front().status, InStatus::kStall);
  ASSERT_TRUE(faulty->control({0x02, 1, 0, 0x82, 0}, {}, now));
  for (const InTransfer& transfer : run(Duration{200'000'000})) {
    EXPECT_EQ(transfer.status, InStatus::kData);
  }
}

TEST_F(FaultyDeviceTest, Silent) {
  stream("silent@0.3+0.2");
  EXPECT_TRUE(run_into_fault().empty());
  EXPECT_GE(run(Duration{200'000'000}).size(), 5U);
}

TEST_F(FaultyDeviceTest, BrokenOnTheWire) {
  stream("broken@0.3+0.2");
  for (const InTransfer& transfer : run_into_fault()) {
    EXPECT_EQ(transfer.status, InStatus::kBroken);
  }
}

TEST_F(FaultyDeviceTest, FrozenImagesUnderNewHeaders) {
  stream("frozen@0.3+0.2");
  const auto during = run_into_fault();
  ASSERT_GE(during.size(), 4U);
  const auto image = [&](std::size_t i) { return std::span{during[i].data}.subspan(232); };
  EXPECT_TRUE(std::ranges::equal(image(1), image(3)));
  EXPECT_NE(field<std::uint32_t>(during[1].data, 28), field<std::uint32_t>(during[3].data, 28));
}

TEST_F(FaultyDeviceTest, SpoiledFrames) {
  for (const std::string name : {"short", "corrupt", "bad-header", "error-bit", "no-metadata"}) {
    world = std::make_unique<ScriptedWorld>();
    stream(name + "@0.3+0.2:depth");
    const auto during = run_into_fault();
    ASSERT_FALSE(during.empty()) << name;
    const Bytes& data = during.front().data;
    if (name == "short") {
      EXPECT_EQ(data.size(), kPayload / 2);
    } else if (name == "corrupt") {
      ASSERT_EQ(data.size(), kPayload);
      const Bytes pixels = ScriptedWorld::pixels(9, 2);
      EXPECT_FALSE(std::ranges::equal(std::span{data}.subspan(232), pixels));
    } else if (name == "bad-header") {
      EXPECT_EQ(field<std::uint8_t>(data, 0), 1);
    } else if (name == "error-bit") {
      EXPECT_EQ(field<std::uint8_t>(data, 1) & 0xfe, 0xce);
    } else {
      EXPECT_EQ(data.size(), kPayload - 220);
      EXPECT_EQ(field<std::uint8_t>(data, 0), 12);
    }
  }
}

TEST_F(FaultyDeviceTest, OtherStreamsGoOn) {
  stream("silent@0.3+0.2:color");
  EXPECT_GE(run_into_fault().size(), 5U);
}

TEST_F(FaultyDeviceTest, ReportsOfTheOtherLayout) {
  for (int i = 0; i < 200; ++i) {
    world->add_imu({}, i * Duration{5'000'000});
  }
  plug();
  const auto parsed = parse_fault("other-layout@0.1");
  ASSERT_TRUE(parsed);
  faulty = std::make_unique<FaultyDevice>(*camera, std::vector{*parsed});
  ASSERT_TRUE(set(0x21, 9, 0x0301, 5, bytes_of({1, 1, 2, 2, 0, 0xf4, 1, 0, 0})));
  std::vector<std::size_t> sizes;
  for (int i = 0; i < 200; ++i, now += Duration{1'000'000}) {
    if (const auto report = faulty->next_in(0x86, now); report.status == InStatus::kData) {
      sizes.push_back(report.data.size());
    }
  }
  ASSERT_FALSE(sizes.empty());
  EXPECT_EQ(sizes.front(), 32U);
  EXPECT_EQ(sizes.back(), 38U);
}

}  // namespace
}  // namespace geoflow::emulator
