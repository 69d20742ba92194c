#include "src/descriptors.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <fmt/core.h>

#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/stream_table.hpp"

namespace geoflow::emulator {
namespace {

constexpr unsigned kByteBits = 8;
constexpr std::string_view kProduct = "Intel(R) RealSense(TM) Depth Camera 435i";

enum DescriptorType : std::uint8_t {
  kDevice = 1,
  kConfiguration = 2,
  kString = 3,
  kBos = 0x0f,
  kHid = 0x21,
  kHidReport = 0x22,
};

// NOLINTBEGIN(readability-magic-numbers): descriptors are tables of numbers; each line says which
// fields they are

bool is_wide(const D435iOptions& options) {
  return options.firmware >= kWideImuFirmware;
}

Bytes device_descriptor(const D435iOptions& options) {
  const unsigned release =
      0x5000U | (unsigned{options.firmware.minor} << 4U) | options.firmware.patch;
  return ByteWriter{}
      .u8(18)
      .u8(kDevice)
      .u16(0x0320)  // bcdUSB
      .u8(0xef)
      .u8(2)
      .u8(1)
      .u8(9)  // class of interface associations, bMaxPacketSize0 2^9
      .u16(0x8086)
      .u16(0x0b3a)
      .u16(release)
      .u8(1)
      .u8(2)
      .u8(3)
      .u8(1)  // strings of maker, product and serial; one configuration
      .take();
}

void put_interface(ByteWriter& to, std::uint8_t number, std::uint8_t endpoints,
                   std::array<std::uint8_t, 3> class_code, std::uint8_t name) {
  to.u8(9).u8(4).u8(number).u8(0).u8(endpoints).bytes(class_code).u8(name);
}

void put_association(ByteWriter& to, std::uint8_t first, std::uint8_t count, std::uint8_t name) {
  to.u8(8).u8(0x0b).u8(first).u8(count).u8(14).u8(3).u8(0).u8(name);
}

void put_interrupt_endpoint(ByteWriter& to, std::uint8_t address, std::uint8_t interval) {
  to.u8(7).u8(5).u8(address).u8(3).u16(64).u8(interval);
  to.u8(6).u8(0x30).u8(0).u8(0).u16(64);  // SuperSpeed companion
  to.u8(5).u8(0x25).u8(3).u16(64);        // class-specific: wMaxTransferSize
}

void put_bulk_endpoint(ByteWriter& to, std::uint8_t address) {
  to.u8(7).u8(5).u8(address).u8(2).u16(1024).u8(0);
  to.u8(6).u8(0x30).u8(15).u8(0).u16(0);  // SuperSpeed companion: bursts of 16
}

void put_input_terminal(ByteWriter& to, std::uint8_t id, std::array<std::uint8_t, 3> controls) {
  to.u8(18).u8(0x24).u8(2).u8(id).u16(0x0201).u8(0).u8(0).u16(0).u16(0).u16(0).u8(3).bytes(
      controls);
}

void put_processing_unit(ByteWriter& to, std::uint8_t id, std::uint8_t source,
                         std::array<std::uint8_t, 3> controls) {
  to.u8(13).u8(0x24).u8(5).u8(id).u8(source).u16(16384).u8(3).bytes(controls).u8(0).u8(0);
}

struct ExtensionUnit {
  std::uint8_t id = 0;
  std::uint8_t source = 0;
  std::array<std::uint8_t, 16> guid{};
  std::uint8_t control_count = 0;
  std::array<std::uint8_t, 3> controls{};
  std::uint8_t name = 0;
};

void put_extension_unit(ByteWriter& to, const ExtensionUnit& unit) {
  to.u8(28)
      .u8(0x24)
      .u8(6)
      .u8(unit.id)
      .bytes(unit.guid)
      .u8(unit.control_count)
      .u8(1)
      .u8(unit.source);
  to.u8(3).bytes(unit.controls).u8(unit.name);
}

void put_output_terminal(ByteWriter& to, std::uint8_t id, std::uint8_t source) {
  to.u8(9).u8(0x24).u8(3).u8(id).u16(0x0101).u8(0).u8(source).u8(0);
}

/// The VideoControl header, with the size of it and of `units`, and then these.
void put_control_header(ByteWriter& to, std::span<const std::uint8_t> streaming,
                        const ByteWriter& units) {
  const std::size_t length = 12 + streaming.size();
  to.u8(static_cast<unsigned>(length)).u8(0x24).u8(1).u16(0x0150);
  to.u16(static_cast<unsigned>(length + units.size())).u32(48'000'000);  // dwClockFrequency
  to.u8(static_cast<unsigned>(streaming.size())).bytes(streaming).bytes(units.view());
}

constexpr std::array<std::uint8_t, 3> kVideoControlClass{14, 1, 0};
constexpr std::array<std::uint8_t, 3> kVideoStreamingClass{14, 2, 0};

void put_depth_control(ByteWriter& to, bool wide) {
  ByteWriter units;
  put_input_terminal(units, 1, {0, 0, 0x20});
  put_processing_unit(units, 2, 1, {0, 2, 0});
  put_extension_unit(units, {.id = 3,
                             .source = 2,
                             .guid = {0xcb, 0x6c, 0x60, 0xc9, 0x4c, 0x59, 0x25, 0x4d, 0xaf, 0x47,
                                      0xcc, 0xc4, 0x96, 0x43, 0x59, 0x95},
                             .control_count = static_cast<std::uint8_t>(wide ? 17 : 16),
                             .controls = {0xff, 0xdd, static_cast<std::uint8_t>(wide ? 1 : 0)},
                             .name = 6});
  put_output_terminal(units, 4, 3);
  put_output_terminal(units, 5, 3);
  put_interface(to, kDepthControlInterface, 1, kVideoControlClass, 5);
  put_control_header(to, std::array<std::uint8_t, 2>{1, 2}, units);
  put_interrupt_endpoint(to, kStatusEndpoint, 6);
}

void put_color_control(ByteWriter& to) {
  ByteWriter units;
  put_input_terminal(units, 6, {0x0e, 0, 0});
  put_processing_unit(units, 7, 6, {0x7f, 0x17, 0});
  put_extension_unit(units, {.id = 8,
                             .source = 7,
                             .guid = {0x6e, 0x41, 0xec, 0xb8, 0xac, 0xa3, 0x80, 0x45, 0x8d, 0x5c,
                                      0x0b, 0xee, 0x15, 0x97, 0xe4, 0x3d},
                             .control_count = 2,
                             .controls = {3, 0, 0},
                             .name = 0});
  put_output_terminal(units, 9, 7);
  put_interface(to, kColorControlInterface, 0, kVideoControlClass, 6);
  put_control_header(to, std::array<std::uint8_t, 1>{4}, units);
}

void put_frame(ByteWriter& to, const VideoFormat& format, std::uint8_t index) {
  const FrameSize& size = format.sizes[index - 1U];
  const auto bits_per_second = [&](std::uint32_t interval) {
    return std::uint64_t{frame_bytes(format, size)} * kByteBits * frames_per_second(interval);
  };
  const auto count = static_cast<unsigned>(size.intervals_100ns.size());
  to.u8(26 + 4 * count).u8(0x24).u8(0x11).u8(index).u8(0).u16(size.width).u16(size.height);
  to.u32(bits_per_second(size.intervals_100ns.back()));
  to.u32(bits_per_second(size.intervals_100ns.front()));
  to.u32(size.intervals_100ns.front()).u8(count).u32(row_bytes(format, size));
  for (const std::uint32_t interval : size.intervals_100ns) {
    to.put(interval);
  }
}

void put_format(ByteWriter& to, const VideoFormat& format, std::uint8_t index) {
  const auto sizes = static_cast<std::uint8_t>(format.sizes.size());
  to.u8(28).u8(0x24).u8(0x10).u8(index).u8(sizes).bytes(format.guid).u8(format.bits_per_pixel);
  to.u8(1).u8(0).u8(0).u8(0).u8(0).u8(
      0);  // default frame, aspect, interlace, copy protection, size
  for (std::uint8_t frame = 1; frame <= sizes; ++frame) {
    put_frame(to, format, frame);
  }
  to.u8(6).u8(0x24).u8(0x0d).u8(0).u8(0).u8(0);  // COLORFORMAT
}

void put_streaming(ByteWriter& to, const VideoInterface& video, bool wide) {
  const auto count = static_cast<std::uint8_t>(video.formats.size());
  ByteWriter formats;
  for (std::uint8_t index = 1; index <= count; ++index) {
    put_format(formats, video.formats[index - 1U], index);
  }
  put_interface(to, video.number, 1, kVideoStreamingClass, video.name_string);
  const std::size_t length = 13U + count;
  to.u8(static_cast<unsigned>(length)).u8(0x24).u8(1).u8(count);
  to.u16(static_cast<unsigned>(length + formats.size()))
      .u8(video.endpoint)
      .u8(0)
      .u8(video.terminal);
  to.u8(0).u8(0).u8(0).u8(1);  // still capture, trigger, its use; bControlSize
  for (std::uint8_t index = 0; index < count; ++index) {
    to.u8(wide ? 0 : 0x1c);  // bmaControls
  }
  to.bytes(formats.view());
  put_bulk_endpoint(to, video.endpoint);
}

void put_hid(ByteWriter& to, bool wide) {
  put_interface(to, kHidInterface, 1, {3, 0, 0}, 9);
  const std::size_t report_length = hid_report_descriptor(wide).size();
  to.u8(9)
      .u8(kHid)
      .u16(0x0110)
      .u8(0)
      .u8(1)
      .u8(kHidReport)
      .u16(static_cast<unsigned>(report_length));
  put_interrupt_endpoint(to, kHidEndpoint, 2);
}

Bytes configuration_descriptor(const D435iOptions& options) {
  const bool wide = is_wide(options);
  const auto video = video_interfaces();
  ByteWriter content;
  put_association(content, kDepthControlInterface, 3, 5);
  put_depth_control(content, wide);
  put_streaming(content, video[0], wide);
  put_streaming(content, video[1], wide);
  put_association(content, kColorControlInterface, 2, 6);
  put_color_control(content);
  put_streaming(content, video[2], wide);
  put_hid(content, wide);
  ByteWriter whole;
  whole.u8(9).u8(kConfiguration).u16(static_cast<unsigned>(9 + content.size())).u8(6).u8(1).u8(0);
  whole.u8(0xc0).u8(440 / 8);  // self-powered, 440 mA in units of 8 mA
  return whole.bytes(content.view()).take();
}

Bytes bos_descriptor() {
  ByteWriter to;
  to.u8(5).u8(kBos).u16(50).u8(3);
  to.u8(10).u8(0x10).u8(3).u8(0).u16(0x000c).u8(3).u8(10).u16(0x07ff);  // SuperSpeed
  to.u8(7).u8(0x10).u8(2).u32(6);                                       // USB 2.0 extension
  to.u8(28).u8(0x10).u8(5).u8(0);                                       // Microsoft OS 2.0
  to.bytes(std::array<std::uint8_t, 16>{0xdf, 0x60, 0xdd, 0xd8, 0x89, 0x45, 0xc7, 0x4c, 0x9c, 0xd2,
                                        0x65, 0x9d, 0x9e, 0x64, 0x8a, 0x9f});
  to.bytes(std::array<std::uint8_t, 8>{0, 0, 3, 6, 0x44, 2, 0x20, 0});
  return to.take();
}

/// The strings that real cameras were seen to have; 4 and 7 were not.
std::optional<std::string> string_of(const D435iOptions& options, std::uint8_t index) {
  switch (index) {
    case 1:
    case 2:
      return std::string{kProduct};
    case 3:
      return options.asic_serial;
    case 5:
      return fmt::format("{} Depth", kProduct);
    case 6:
      return fmt::format("{} RGB", kProduct);
    case 8:
      return fmt::format("{} Y", kProduct);
    case 9:
      return "Intel(R) RealSense(TM) HID";
    default:
      return std::nullopt;
  }
}

std::optional<Bytes> string_descriptor(const D435iOptions& options, std::uint8_t index) {
  if (index == 0) {
    return ByteWriter{}.u8(4).u8(kString).u16(0x0409).take();  // English (United States)
  }
  const auto text = string_of(options, index);
  if (!text) {
    return std::nullopt;
  }
  ByteWriter to;
  to.u8(static_cast<unsigned>(2 + 2 * text->size())).u8(kString);
  for (const char character : *text) {
    to.u16(static_cast<unsigned char>(character));
  }
  return to.take();
}

// NOLINTEND(readability-magic-numbers)

}  // namespace

std::optional<Bytes> descriptor(const D435iOptions& options, std::uint16_t value) {
  const auto index = static_cast<std::uint8_t>(value);
  const auto type = static_cast<std::uint8_t>(value >> kByteBits);
  if (type == kString) {
    return string_descriptor(options, index);
  }
  if (index != 0) {
    return std::nullopt;
  }
  switch (type) {
    case kDevice:
      return device_descriptor(options);
    case kConfiguration:
      return configuration_descriptor(options);
    case kBos:
      return bos_descriptor();
    case kHidReport:
      return hid_report_descriptor(is_wide(options));
    default:
      return std::nullopt;
  }
}

}  // namespace geoflow::emulator
