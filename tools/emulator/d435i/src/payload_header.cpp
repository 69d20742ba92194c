#include "src/payload_header.hpp"

#include <cstddef>
#include <cstdint>

#include "geoflow/tools/emulator/byte_writer.hpp"

#include "src/uvc_controls.hpp"

namespace geoflow::emulator {
namespace {

constexpr std::size_t kStandardSize = 12;
constexpr std::uint32_t kMicrosecondsPerMillisecond = 1000;
constexpr std::uint32_t kColorExposureUnitUs = 100;

/// One block: identifier, size, and its version where it has one.
struct Block {
  std::uint32_t id = 0;
  std::uint32_t size = 0;
  std::uint32_t version = 0;
  std::uint32_t flags = 0;
};
// NOLINTBEGIN(modernize-use-designated-initializers): a table, in the order of Block's members
constexpr Block kCaptureTiming{0x80000001, 40, 1, 0x3f};
constexpr Block kCaptureStats{0x00000003, 80, 0, 0xc01};  // exposure, frame rate and time are valid
constexpr Block kDepthControl{0x80000000, 60, 1, 0xff};
constexpr Block kRgbControl{0x80000005, 72, 1, 0x3fff};
constexpr Block kConfiguration{0x80000002, 40, 3, 0x7ff};
// NOLINTEND(modernize-use-designated-initializers)
constexpr std::size_t kBlocks = kCaptureTiming.size + kCaptureStats.size + kConfiguration.size;

/// Depth type, projector, colour and IMU (kernel documentation, metafmt-d4xx: sku_id).
constexpr std::uint8_t kSku = 0x1d;

void put_block(const Block& block, ByteWriter& to) {
  to.put(block.id).put(block.size).put(block.version).put(block.flags);
}

std::uint32_t exposure_us(const FrameFacts& facts, const UvcControls& controls) {
  return facts.color
             ? static_cast<std::uint32_t>(controls.value(kColorTerminal, kTerminalExposure)) *
                   kColorExposureUnitUs
             : static_cast<std::uint32_t>(controls.value(DepthSelector::kExposure));
}

void put_timing(const FrameFacts& facts, std::uint32_t exposure, ByteWriter& to) {
  put_block(kCaptureTiming, to);
  to.put(facts.counter).put(facts.since_exposure_us).u32(0);  // readout
  to.put(exposure).put(facts.interval_us).u32(0);             // pipe latency
}

void put_stats(const FrameFacts& facts, std::uint32_t exposure, ByteWriter& to) {
  constexpr int kNotSaid = 10;  // 32-bit fields from exp_comp_flags to zoom
  to.put(kCaptureStats.id).put(kCaptureStats.size).put(kCaptureStats.flags);
  to.u32(facts.stamp_us).put(std::uint64_t{exposure});
  for (int field = 0; field < kNotSaid; ++field) {
    to.u32(0);
  }
  to.put(std::uint64_t{0}).put(std::uint64_t{facts.fps});  // scene mode, frame rate
}

void put_depth_control(const FrameFacts& facts, const UvcControls& controls, ByteWriter& to) {
  put_block(kDepthControl, to);
  const auto say = [&](std::int64_t value) { to.u32(static_cast<std::uint64_t>(value)); };
  say(controls.value(kDepthProcessing, kProcessingGain));
  say(controls.value(DepthSelector::kExposure));
  say(controls.value(DepthSelector::kLaserPower));
  say(controls.value(DepthSelector::kAutoExposure));
  to.u32(0);  // exposure priority
  to.u32(0)
      .u32(facts.width - 1U)
      .u32(0)
      .u32(facts.height - 1U);  // region: left, right, top, bottom
  say(controls.value(DepthSelector::kPreset));
  to.put(static_cast<std::uint8_t>(controls.value(DepthSelector::kEmitter)));
  to.u8(0).u16(0);
}

void put_color_control(const UvcControls& controls, ByteWriter& to) {
  put_block(kRgbControl, to);
  const auto terminal = [&](std::uint8_t selector) {
    to.u32(static_cast<std::uint64_t>(controls.value(kColorTerminal, selector)));
  };
  const auto processing = [&](unsigned selector) {
    to.u32(static_cast<std::uint64_t>(
        controls.value(kColorProcessing, static_cast<std::uint8_t>(selector))));
  };
  // NOLINTBEGIN(readability-magic-numbers): selectors of UVC 1.5, table A-15, in the block's order
  for (const unsigned selector : {0x02U, 0x03U, 0x07U, 0x08U}) {  // brightness to sharpness
    processing(selector);
  }
  terminal(kTerminalAutoExposureMode);
  for (const unsigned selector : {0x0bU, 0x04U, 0x01U, 0x09U, 0x06U}) {  // balance mode to hue
    processing(selector);
  }
  terminal(kTerminalExposure);
  processing(0x0a);  // white balance
  processing(0x05);  // power line
  terminal(kTerminalAutoExposurePriority);
  // NOLINTEND(readability-magic-numbers)
}

void put_configuration(const FrameFacts& facts, ByteWriter& to) {
  put_block(kConfiguration, to);
  to.u8(0).u8(kSku).u32(0).put(facts.format_code);  // hardware, cookie
  to.put(facts.width).put(facts.height).put(facts.fps);
  to.u16(0).u16(0).u8(0).u32(0).u8(0);  // trigger, calibration count, gpio, subpreset
}

}  // namespace

void put_payload_header(const FrameFacts& facts, const UvcControls& controls, ByteWriter& to) {
  constexpr unsigned kEndOfHeaderClockStampEndOfFrame = 0x8e;
  constexpr unsigned kErrorBit = 0x40;
  constexpr std::uint32_t kBusFrames = 0x7ff;
  const std::size_t control = facts.color ? kRgbControl.size : kDepthControl.size;
  const std::size_t size = kStandardSize + (facts.bare ? 0 : kBlocks + control);
  to.u8(static_cast<unsigned>(size));
  to.u8(kEndOfHeaderClockStampEndOfFrame | (facts.odd ? 1U : 0U) | (facts.failed ? kErrorBit : 0U));
  to.u32(facts.stamp_us).u32(facts.stamp_us);
  to.u16(static_cast<unsigned>(facts.stamp_us / kMicrosecondsPerMillisecond) & kBusFrames);
  if (facts.bare) {
    return;
  }
  const std::uint32_t exposure = exposure_us(facts, controls);
  put_timing(facts, exposure, to);
  put_stats(facts, exposure, to);
  if (facts.color) {
    put_color_control(controls, to);
  } else {
    put_depth_control(facts, controls, to);
  }
  put_configuration(facts, to);
}

}  // namespace geoflow::emulator
