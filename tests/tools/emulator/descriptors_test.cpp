#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "device_fixture.hpp"

// Figures of real cameras: `lsusb -v` of a D435i with firmware 5.12.7 (librealsense issue 13589)
// and of a D435 (linux-kernel, D. Perchanov, 2023-02-09).
namespace geoflow::emulator {
namespace {

struct DescriptorsTest : DeviceTest {
  /// The descriptors of a configuration, one after the other.
  static std::vector<Bytes> parts_of(const Bytes& configuration) {
    std::vector<Bytes> parts;
    for (std::size_t at = 0; at < configuration.size();) {
      const auto length = std::to_integer<std::size_t>(configuration[at]);
      if (length < 2 || length > configuration.size() - at) {
        ADD_FAILURE() << "a descriptor of " << length << " bytes at " << at;
        break;
      }
      const auto begin = configuration.begin() + static_cast<std::ptrdiff_t>(at);
      parts.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(length));
      at += length;
    }
    return parts;
  }
  static std::uint8_t at(const Bytes& bytes, std::size_t index) {
    return std::to_integer<std::uint8_t>(bytes.at(index));
  }
  std::string text(std::uint8_t index) {
    const Bytes bytes = descriptor(static_cast<std::uint16_t>(0x0300U | index));
    std::string characters;
    for (std::size_t i = 2; i + 1 < bytes.size(); i += 2) {
      characters.push_back(static_cast<char>(bytes[i]));
    }
    return characters;
  }
};

TEST_F(DescriptorsTest, TheDeviceIsAD435iOfItsFirmware) {
  plug();
  EXPECT_EQ(descriptor(0x0100), bytes_of({18, 1, 0x20, 0x03, 0xef, 2, 1, 9, 0x86, 0x80, 0x3a, 0x0b,
                                          0xc7, 0x50, 1, 2, 3, 1}));
  EXPECT_EQ(text(2), "Intel(R) RealSense(TM) Depth Camera 435i");
  EXPECT_EQ(text(3), "843123050435");
  EXPECT_EQ(text(5), "Intel(R) RealSense(TM) Depth Camera 435i Depth");
  EXPECT_EQ(text(6), "Intel(R) RealSense(TM) Depth Camera 435i RGB");
  EXPECT_EQ(text(9), "Intel(R) RealSense(TM) HID");
  EXPECT_FALSE(get(0x80, 6, 0x0304, 0, 255)) << "string 4 was never seen";
}

TEST_F(DescriptorsTest, ANewerFirmwareHasAnotherRelease) {
  plug({.firmware = {5, 16, 4, 0}});
  const Bytes device = descriptor(0x0100);
  EXPECT_EQ(field<std::uint16_t>(device, 12), 0x5104);
}

TEST_F(DescriptorsTest, TheConfigurationAddsUpToThatOfARealCamera) {
  plug();
  const Bytes configuration = descriptor(0x0200);
  EXPECT_EQ(configuration.size(), 3199U);
  EXPECT_EQ(Bytes(configuration.begin(), configuration.begin() + 9),
            bytes_of({9, 2, 0x7f, 0x0c, 6, 1, 0, 0xc0, 55}));
  // Of each class-specific header its total length: two VideoControl and three VideoStreaming
  // interfaces.
  std::vector<std::uint16_t> totals;
  std::size_t subclass = 0;
  for (const Bytes& part : parts_of(configuration)) {
    if (at(part, 1) == 4) {
      subclass = at(part, 6);
      EXPECT_EQ(at(part, 7), 0) << "the protocol of every interface is 0";
    } else if (at(part, 1) == 0x24 && at(part, 2) == 1) {
      totals.push_back(field<std::uint16_t>(part, subclass == 1 ? 5 : 4));
    }
  }
  EXPECT_EQ(totals, (std::vector<std::uint16_t>{91, 755, 1634, 81, 475}));
}

TEST_F(DescriptorsTest, UnitsAndEndpointsAreThoseOfTheDump) {
  plug();
  const auto parts = parts_of(descriptor(0x0200));
  const auto has = [&](const Bytes& wanted) {
    return std::find(parts.begin(), parts.end(), wanted) != parts.end();
  };
  EXPECT_TRUE(has(bytes_of({14, 0x24, 1, 0x50, 1, 91, 0, 0x00, 0x6c, 0xdc, 0x02, 2, 1, 2})));
  EXPECT_TRUE(has(bytes_of({18, 0x24, 2, 1, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0x20})));
  EXPECT_TRUE(has(bytes_of({13, 0x24, 5, 2, 1, 0, 0x40, 3, 0, 2, 0, 0, 0})));
  EXPECT_TRUE(has(
      bytes_of({28,   0x24, 6,    3,    0xcb, 0x6c, 0x60, 0xc9, 0x4c, 0x59, 0x25, 0x4d, 0xaf, 0x47,
                0xcc, 0xc4, 0x96, 0x43, 0x59, 0x95, 16,   1,    2,    3,    0xff, 0xdd, 0,    6})));
  EXPECT_TRUE(has(bytes_of({9, 0x24, 3, 9, 1, 1, 0, 7, 0})));
  EXPECT_TRUE(has(bytes_of({7, 5, 0x87, 3, 64, 0, 6})));
  EXPECT_TRUE(has(bytes_of({7, 5, 0x86, 3, 64, 0, 2})));
  for (const unsigned endpoint : {0x82U, 0x83U, 0x84U}) {
    EXPECT_TRUE(has(bytes_of({7, 5, endpoint, 2, 0, 4, 0})));
  }
  EXPECT_TRUE(has(bytes_of({6, 0x30, 15, 0, 0, 0})));
  EXPECT_TRUE(has(bytes_of({9, 0x21, 0x10, 1, 0, 1, 0x22, 0xe8, 3}))) << "1000 bytes of HID";
}

TEST_F(DescriptorsTest, FramesHaveTheBitRatesOfTheDump) {
  plug();
  /// Format's bits a pixel, width, height: least and most bits a second.
  using Rates = std::pair<std::uint32_t, std::uint32_t>;
  const std::map<std::array<unsigned, 3>, Rates> expected{
      {{16, 256, 144}, {53084160, 176947200}},  {{16, 848, 100}, {135680000, 407040000}},
      {{16, 1280, 720}, {88473600, 442368000}}, {{8, 256, 144}, {26542080, 88473600}},
      {{8, 848, 480}, {19537920, 293068800}},   {{16, 1280, 800}, {245760000, 491520000}},
      {{24, 640, 400}, {92160000, 153600000}},  {{24, 1280, 800}, {368640000, 614400000}},
      {{16, 960, 540}, {49766400, 497664000}}};
  std::map<std::array<unsigned, 3>, Rates> found;
  unsigned bits = 0;
  std::size_t frames = 0;
  for (const Bytes& part : parts_of(descriptor(0x0200))) {
    if (at(part, 1) == 0x24 && at(part, 2) == 0x10) {
      bits = at(part, 21);
    } else if (at(part, 1) == 0x24 && at(part, 2) == 0x11 && part.size() >= 26) {
      found[{bits, field<std::uint16_t>(part, 5), field<std::uint16_t>(part, 7)}] = {
          field<std::uint32_t>(part, 9), field<std::uint32_t>(part, 13)};
      ++frames;
    }
  }
  EXPECT_EQ(frames, 8U + 8U + 8U + 8U + 8U + 9U + 2U + 9U + 1U);
  for (const auto& [size, rates] : expected) {
    EXPECT_EQ(found[size], rates) << size[0] << " bits, " << size[1] << " x " << size[2];
  }
}

TEST_F(DescriptorsTest, TheBinaryObjectStoreHasItsThreeCapabilities) {
  plug();
  const Bytes store = descriptor(0x0f00);
  ASSERT_EQ(store.size(), 50U);
  EXPECT_EQ(Bytes(store.begin(), store.begin() + 15),
            bytes_of({5, 0x0f, 50, 0, 3, 10, 0x10, 3, 0, 0x0c, 0, 3, 10, 0xff, 0x07}));
}

/// Bytes of each report (1 input, 2 feature) by its id, from the items of a report descriptor.
std::map<std::pair<int, int>, std::size_t> report_sizes(const Bytes& items) {
  std::map<std::pair<int, int>, std::size_t> bits;
  std::size_t size = 0;
  std::size_t count = 0;
  int id = 0;
  for (std::size_t at = 0; at < items.size();) {
    const auto head = std::to_integer<unsigned>(items[at]);
    const std::size_t length = (head & 3U) == 3U ? 4U : head & 3U;
    std::uint32_t value = 0;
    for (std::size_t i = length; i-- > 0;) {
      value = (value << 8U) | std::to_integer<unsigned>(items[at + 1 + i]);
    }
    switch (head & 0xfcU) {
      case 0x74:
        size = value;
        break;
      case 0x94:
        count = value;
        break;
      case 0x84:
        id = static_cast<int>(value);
        break;
      case 0x80:
        bits[{id, 1}] += size * count;
        break;
      case 0xb0:
        bits[{id, 2}] += size * count;
        break;
      default:
        break;
    }
    at += 1 + length;
  }
  for (auto& [report, total] : bits) {
    EXPECT_EQ(total % 8, 0U);
    total = total / 8 + 1;  // and the id
  }
  return bits;
}

TEST_F(DescriptorsTest, ImuReportsAreOf32BytesAndFromFirmware516OnOf38) {
  plug();
  Bytes items = get(0x81, 6, 0x2200, 5, 4096).value_or(Bytes{});
  EXPECT_EQ(items.size(), 1000U);
  auto sizes = report_sizes(items);
  for (const int id : {1, 2}) {
    EXPECT_EQ((sizes[{id, 1}]), 32U);
    EXPECT_EQ((sizes[{id, 2}]), 9U);
  }
  world = std::make_unique<ScriptedWorld>();
  plug({.firmware = {5, 16, 0, 1}});
  items = get(0x81, 6, 0x2200, 5, 4096).value_or(Bytes{});
  EXPECT_EQ(items.size(), 1000U);
  sizes = report_sizes(items);
  EXPECT_EQ((sizes[{1, 1}]), 38U);
  EXPECT_EQ((sizes[{2, 1}]), 38U);
}

}  // namespace
}  // namespace geoflow::emulator
