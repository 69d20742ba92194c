#include "d435i/golden.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "d435i/bytes.hpp"

namespace geoflow::drivers::d435i::tests {
namespace {

constexpr std::string_view kFourCcTail = "00 00 10 00 80 00 00 aa 00 38 9b 71";

struct Frame {
  unsigned width;
  unsigned height;
  std::vector<unsigned> intervals;
};

const std::vector<unsigned> kFive{111111, 166666, 333333, 666666, 1666665};
const std::vector<unsigned> kFour{166666, 333333, 666666, 1666665};
const std::vector<unsigned> kThree{333333, 666666, 1666665};
const std::vector<unsigned> kSmallColor{166666, 333333, 1666665};
const std::vector<unsigned> kFast256{33333, 111111};
const std::vector<unsigned> kFast100{33333, 100000};

std::vector<Frame> depth_frames() {
  return {{256, 144, kFast256}, {424, 240, kFive},    {480, 270, kFive}, {640, 360, kFive},
          {640, 480, kFive},    {848, 100, kFast100}, {848, 480, kFive}, {1280, 720, kThree}};
}

std::vector<Frame> color_frames() {
  return {{320, 180, kSmallColor}, {320, 240, kSmallColor}, {424, 240, kFour},
          {640, 360, kFour},       {640, 480, kFour},       {848, 480, kFour},
          {960, 540, kFour},       {1280, 720, kThree},     {1920, 1080, kThree}};
}

Bytes format(unsigned index, std::string_view guid, unsigned bits,
             const std::vector<Frame>& frames) {
  Builder built;
  built.u8({28, 0x24, 0x10, index, static_cast<unsigned>(frames.size())}).hex(guid);
  built.u8({bits, 1, 0, 0, 0, 0, 0});
  unsigned number = 1;
  for (const Frame& frame : frames) {
    const auto count = static_cast<unsigned>(frame.intervals.size());
    const double frame_bits = static_cast<double>(frame.width) * frame.height * bits;
    const auto rate = [&](unsigned interval) {
      return static_cast<std::uint64_t>(std::round(1e7 / interval) * frame_bits);
    };
    built.u8({26 + 4 * count, 0x24, 0x11, number++, 0}).u16(frame.width).u16(frame.height);
    built.u32(rate(frame.intervals.back())).u32(rate(frame.intervals.front()));
    built.u32(frame.intervals.front()).u8({count}).u32(frame.width * bits / 8);
    for (const unsigned interval : frame.intervals) {
      built.u32(interval);
    }
  }
  return built.hex("06 24 0d 00 00 00").get();
}

Bytes fourcc_format(unsigned index, std::string_view code, unsigned bits,
                    const std::vector<Frame>& frames) {
  return format(index, std::string{code}.append(kFourCcTail), bits, frames);
}

/// A streaming interface: its header, formats, endpoint and companion.
Bytes streaming(unsigned number, unsigned string, unsigned endpoint, unsigned terminal,
                const std::vector<Bytes>& formats) {
  const auto count = static_cast<unsigned>(formats.size());
  std::size_t total = 13 + count;
  for (const Bytes& one : formats) {
    total += one.size();
  }
  Builder built;
  built.u8({9, 4, number, 0, 1, 14, 2, 0, string});
  built.u8({13 + count, 0x24, 1, count}).u16(static_cast<unsigned>(total));
  built.u8({endpoint, 0, terminal, 0, 0, 0, 1});
  for (unsigned i = 0; i < count; ++i) {
    built.u8({28});
  }
  for (const Bytes& one : formats) {
    built.bytes(one);
  }
  return built.u8({7, 5, endpoint, 2}).u16(1024).hex("00 06 30 0f 00 00 00").get();
}

Bytes depth_control() {
  return Builder{}
      .hex("09 04 00 00 01 0e 01 00 05")
      .hex("0e 24 01 50 01 5b 00 00 6c dc 02 02 01 02")              // header
      .hex("12 24 02 01 01 02 00 00 00 00 00 00 00 00 03 00 00 20")  // input terminal
      .hex("0d 24 05 02 01 00 40 03 00 02 00 00 00")                 // processing unit
      .hex("1c 24 06 03 cb 6c 60 c9 4c 59 25 4d af 47 cc c4 96 43 59 95 10 01 02 03 ff dd 00 06")
      .hex("09 24 03 04 01 01 00 03 00 09 24 03 05 01 01 00 03 00")  // output terminals
      .hex("07 05 87 03 40 00 06 06 30 00 00 40 00 05 25 03 40 00")
      .get();
}

Bytes color_control() {
  return Builder{}
      .hex("09 04 03 00 00 0e 01 00 06")
      .hex("0d 24 01 50 01 51 00 00 6c dc 02 01 04")
      .hex("12 24 02 06 01 02 00 00 00 00 00 00 00 00 03 0e 00 00")
      .hex("0d 24 05 07 06 00 40 03 7f 17 00 00 00")
      .hex("1c 24 06 08 6e 41 ec b8 a3 ac 80 45 8d 5c 0b ee 15 97 e4 3d 02 01 07 03 03 00 00 00")
      .hex("09 24 03 09 01 01 00 07 00")
      .get();
}

std::vector<Frame> infrared_frames() {
  return depth_frames();
}

Bytes depth_stream() {
  return streaming(1, 5, 0x82, 4,
                   {fourcc_format(1, "5a 31 36 20", 16, depth_frames()),
                    fourcc_format(2, "50 00 00 00", 16, depth_frames())});
}

Bytes infrared_stream() {
  auto interleaved = infrared_frames();
  interleaved.push_back({1280, 800, {333333, 666666}});
  const std::vector<Frame> raw{{640, 400, {400000, 666666}}, {1280, 800, {400000, 666666}}};
  return streaming(
      2, 8, 0x83, 5,
      {fourcc_format(1, "32 00 00 00", 8, infrared_frames()),
       fourcc_format(2, "55 59 56 59", 16, infrared_frames()),
       fourcc_format(3, "59 38 20 20", 8, infrared_frames()),
       fourcc_format(4, "59 38 49 20", 16, interleaved), fourcc_format(5, "59 31 32 49", 24, raw)});
}

Bytes color_stream(const std::vector<Frame>& frames) {
  return streaming(
      4, 6, 0x84, 9,
      {fourcc_format(1, "59 55 59 32", 16, frames),
       format(2, "52 57 31 36 66 1a 42 a2 90 65 d0 18 14 a8 ef 8a", 16, {{1920, 1080, {333333}}})});
}

Bytes hid() {
  return from_hex(
      "09 04 05 00 01 03 00 00 09  09 21 10 01 00 01 22 e8 03"
      "07 05 86 03 40 00 02  06 30 00 00 40 00  05 25 00 00 00");
}

Bytes configuration(const Bytes& depth, const Bytes& infrared, const Bytes& color) {
  Builder body;
  body.hex("08 0b 00 03 0e 03 00 05").bytes(depth_control()).bytes(depth).bytes(infrared);
  body.hex("08 0b 03 02 0e 03 00 06").bytes(color_control()).bytes(color).bytes(hid());
  return Builder{}
      .u8({9, 2})
      .u16(static_cast<unsigned>(9 + body.size()))
      .u8({6, 1, 0, 0xc0, 55})
      .bytes(body.get())
      .get();
}

}  // namespace

Bytes golden_configuration() {
  return configuration(depth_stream(), infrared_stream(), color_stream(color_frames()));
}

Bytes usb2_configuration() {
  const std::vector<Frame> depth{{480, 270, kFour}, {640, 480, kThree}, {1280, 720, {1666665}}};
  const std::vector<Frame> color{{424, 240, kFour}, {640, 480, kThree}};
  return configuration(streaming(1, 5, 0x82, 4, {fourcc_format(1, "5a 31 36 20", 16, depth)}),
                       streaming(2, 8, 0x83, 5, {fourcc_format(1, "32 00 00 00", 8, depth)}),
                       color_stream(color));
}

Bytes golden_depth_header(std::uint32_t pts_us, std::uint32_t frame_counter) {
  Builder built;
  built.u8({232, 0x8f}).u32(pts_us).u32(0x12345678).u16(0x0123);
  // Capture timing: counter, optical time, readout, exposure, interval, latency.
  built.u32(0x80000001).u32(40).u32(1).u32(0x3f);
  built.u32(frame_counter).u32(4250).u32(16000).u32(8500).u32(33333).u32(35000);
  // Capture stats: only the hardware's time is valid.
  built.u32(3).u32(80).u32(1U << 11U).u32(pts_us).zeros(64);
  // Depth control, version 3.
  built.u32(0x80000000).u32(60).u32(3).u32(0x1ff);
  built.u32(16).u32(8500).u32(150).u32(1).u32(0).u32(0).u32(847).u32(0).u32(479).u32(0);
  built.u8({1, 0}).u16(0);
  // Configuration, version 3: Z16 848x480 at 30 Hz.
  built.u32(0x80000002).u32(40).u32(3).u32(0x7ff);
  built.u8({0, 0x1e}).u32(0).u16(1).u16(848).u16(480).u16(30).u16(1).u16(2).u8({0}).u32(0).u8({0});
  return built.get();
}

Bytes with_table_header(unsigned type, const Bytes& payload) {
  return Builder{}
      .u8({1, 1})  // version, big-endian
      .u16(type)
      .u32(payload.size())
      .u32(0)
      .u32(plain_crc32(payload))
      .bytes(payload)
      .get();
}

Bytes golden_depth_table() {
  Builder payload;
  payload.zeros(4 * 36).f32(-49.95F).u32(0).zeros(88);
  // 1920x1080 first: that the crop and the scaled sizes go by; 848x480 and 640x480 as reported.
  payload.f32s({957.2F, 957.2F, 959.5F, 538.2F});
  payload.f32s({638.1F, 638.1F, 639.7F, 358.8F});
  payload.f32s({382.9F, 382.9F, 319.9F, 236.1F});
  payload.f32s({422.8F, 422.8F, 423.8F, 235.7F});
  payload.f32s({319.1F, 319.1F, 319.8F, 179.4F});
  payload.f32s({211.4F, 211.4F, 211.9F, 119.6F});
  payload.zeros(6 * 16).zeros(64);
  return with_table_header(25, payload.zeros(512 - 16 - payload.size()).get());
}

Bytes golden_color_table() {
  // For 640x480: fx 612.4, fy 610.6, cx 314.3, cy 237.8 of a sensor calibrated at 1920x1080.
  const float wide = 0.75F;  // 4:3 shows 3/4 of the width of 16:9
  Builder payload;
  payload.f32s({2 * 612.4F / 640 * wide, 0, 0});
  payload.f32s({0, 2 * 610.6F / 480, 0});
  payload.f32s({(2 * 314.3F / 640 - 1) * wide, 2 * 237.8F / 480 - 1, 1});
  payload.zeros(5 * 4 + 3 * 4 + 3 * 4 + 12 * 4).u16(1920).u16(1080).zeros(36);
  payload.f32s({0.999956F, 0.009402F, 0.000691F});
  payload.f32s({-0.009402F, 0.999955F, 0.000861F});
  payload.f32s({-0.000683F, -0.000868F, 0.999999F});
  payload.f32s({15.01F, -1.36F, 0.25F});
  return with_table_header(32, payload.zeros(256 - 16 - payload.size()).get());
}

Bytes golden_versions() {
  Bytes data(248);
  const auto set = [&](std::size_t at, std::string_view hex) {
    for (const std::byte byte : from_hex(hex)) {
      data.at(at++) = byte;
    }
  };
  set(0, "01 02");
  set(12, "64 07 0c 05");
  set(48, "83 11 22 07 01 53");
  set(64, "85 01 23 05 03 07");
  set(112, "ff ff");
  set(124, "fa");
  set(166, "02");
  set(170, "01");
  set(174, "01");
  set(178, "01");
  return data;
}

}  // namespace geoflow::drivers::d435i::tests
