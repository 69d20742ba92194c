#include "d435i/uvc/descriptors.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "fields.hpp"

namespace geoflow::drivers::d435i {
namespace {

// bDescriptorType
constexpr std::uint8_t kConfiguration = 0x02;
constexpr std::uint8_t kInterface = 0x04;
constexpr std::uint8_t kEndpoint = 0x05;
constexpr std::uint8_t kHidClass = 0x21;
constexpr std::uint8_t kClassInterface = 0x24;
// bInterfaceClass and bInterfaceSubClass
constexpr std::uint8_t kClassHid = 0x03;
constexpr std::uint8_t kClassVideo = 0x0e;
constexpr std::uint8_t kVideoControl = 0x01;
constexpr std::uint8_t kVideoStreaming = 0x02;
// bDescriptorSubtype of VideoControl
constexpr std::uint8_t kControlHeader = 0x01;
constexpr std::uint8_t kExtensionUnit = 0x06;
// bDescriptorSubtype of VideoStreaming
constexpr std::uint8_t kInputHeader = 0x01;
constexpr std::uint8_t kFormatUncompressed = 0x04;
constexpr std::uint8_t kFrameUncompressed = 0x05;
constexpr std::uint8_t kFormatFrameBased = 0x10;
constexpr std::uint8_t kFrameFrameBased = 0x11;
// bmAttributes of an endpoint
constexpr std::uint8_t kTransferType = 0x03;
constexpr std::uint8_t kBulk = 0x02;
constexpr std::uint8_t kDirectionIn = 0x80;

constexpr std::uint8_t kBitsPerByte = 8;

/// A format's GUID is its four-character code and this.
constexpr std::array<std::uint8_t, 12> kFourCcTail{0x00, 0x00, 0x10, 0x00, 0x80, 0x00,
                                                   0x00, 0xaa, 0x00, 0x38, 0x9b, 0x71};

PixelCoding coding_of(const Guid& guid) {
  const auto code = std::span{guid}.first<4>();
  for (std::size_t i = 0; i < kFourCcTail.size(); ++i) {
    if (guid.at(code.size() + i) != std::byte{kFourCcTail.at(i)}) {
      return PixelCoding::kOther;
    }
  }
  const auto is = [&](std::string_view text) {
    return std::ranges::equal(code, std::as_bytes(std::span{text}));
  };
  if (is("Z16 ")) {
    return PixelCoding::kZ16;
  }
  return is("YUY2") ? PixelCoding::kYuyv : PixelCoding::kOther;
}

Guid take_guid(FieldReader& fields) {
  Guid guid{};
  std::ranges::copy(fields.take_bytes(guid.size()), guid.begin());
  return guid;
}

/// Collects descriptors in their order. Each handler gets the fields behind type and subtype, and
/// checks nothing: the caller asks the reader whether all of them were there.
class Collector {
 public:
  void on_interface(FieldReader& fields) {
    const auto number = fields.take<std::uint8_t>();
    const auto alternate = fields.take<std::uint8_t>();
    fields.skip(1);  // bNumEndpoints
    const auto device_class = fields.take<std::uint8_t>();
    const auto subclass = fields.take<std::uint8_t>();
    kind_ = Kind::kNone;
    if (alternate != 0 || !fields.ok()) {
      return;
    }
    if (device_class == kClassVideo && subclass == kVideoControl) {
      kind_ = Kind::kControl;
      found.controls.push_back({.number = number});
    } else if (device_class == kClassVideo && subclass == kVideoStreaming) {
      kind_ = Kind::kStreaming;
      found.streams.push_back({.number = number});
    } else if (device_class == kClassHid) {
      kind_ = Kind::kHid;
      found.hid = HidInterface{.number = number};
    }
  }

  void on_endpoint(FieldReader& fields) {
    const auto address = fields.take<std::uint8_t>();
    const auto attributes = fields.take<std::uint8_t>();
    const auto max_packet = fields.take<std::uint16_t>();
    if ((address & kDirectionIn) == 0) {
      return;
    }
    if (kind_ == Kind::kStreaming) {
      found.streams.back().endpoint = address;
      found.streams.back().max_packet = max_packet;
      found.streams.back().bulk = (attributes & kTransferType) == kBulk;
    } else if (kind_ == Kind::kHid) {
      found.hid->endpoint = address;
      found.hid->max_packet = max_packet;
    }
  }

  void on_hid(FieldReader& fields) {
    if (kind_ != Kind::kHid) {
      return;
    }
    constexpr std::size_t kVersionCountryCountAndType = 5;
    fields.skip(kVersionCountryCountAndType);
    found.hid->report_descriptor_bytes = fields.take<std::uint16_t>();
  }

  void on_class_interface(FieldReader& fields) {
    const auto subtype = fields.take<std::uint8_t>();
    if (kind_ == Kind::kControl && subtype == kControlHeader) {
      on_control_header(fields);
    } else if (kind_ == Kind::kControl && subtype == kExtensionUnit) {
      on_extension_unit(fields);
    } else if (kind_ == Kind::kStreaming && subtype == kInputHeader) {
      on_input_header(fields);
    } else if (kind_ == Kind::kStreaming &&
               (subtype == kFormatUncompressed || subtype == kFormatFrameBased)) {
      on_format(fields);
    } else if (kind_ == Kind::kStreaming &&
               (subtype == kFrameUncompressed || subtype == kFrameFrameBased)) {
      on_frame(fields, subtype == kFrameFrameBased);
    }
  }

  UsbDescription found{};

 private:
  enum class Kind : std::uint8_t { kNone, kControl, kStreaming, kHid };

  void on_control_header(FieldReader& fields) {
    ControlInterface& control = found.controls.back();
    control.uvc_version = fields.take<std::uint16_t>();
    fields.skip(sizeof(std::uint16_t) + sizeof(std::uint32_t));  // wTotalLength, dwClockFrequency
    const auto count = fields.take<std::uint8_t>();
    for (const std::byte number : fields.take_bytes(count)) {
      control.streaming.push_back(std::to_integer<std::uint8_t>(number));
    }
  }

  void on_extension_unit(FieldReader& fields) {
    ExtensionUnit unit{
        .id = fields.take<std::uint8_t>(), .guid = take_guid(fields), .controls = {}};
    fields.skip(1);                            // bNumControls
    fields.skip(fields.take<std::uint8_t>());  // baSourceID
    const auto bitmap = fields.take_bytes(fields.take<std::uint8_t>());
    unit.controls.assign(bitmap.begin(), bitmap.end());
    found.controls.back().extension_units.push_back(std::move(unit));
  }

  void on_input_header(FieldReader& fields) {
    StreamingInterface& stream = found.streams.back();
    fields.skip(1 + sizeof(std::uint16_t));  // bNumFormats, wTotalLength
    stream.endpoint = fields.take<std::uint8_t>();
    fields.skip(1);  // bmInfo
    stream.terminal_link = fields.take<std::uint8_t>();
  }

  void on_format(FieldReader& fields) {
    UvcFormat format{.index = fields.take<std::uint8_t>(), .frames = {}};
    fields.skip(1);  // bNumFrameDescriptors
    format.guid = take_guid(fields);
    format.coding = coding_of(format.guid);
    format.bits_per_pixel = fields.take<std::uint8_t>();
    found.streams.back().formats.push_back(std::move(format));
  }

  void on_frame(FieldReader& fields, bool frame_based) {
    UvcFrame frame{.index = fields.take<std::uint8_t>(), .intervals_100ns = {}};
    fields.skip(1);  // bmCapabilities
    frame.width = fields.take<std::uint16_t>();
    frame.height = fields.take<std::uint16_t>();
    fields.skip(2 * sizeof(std::uint32_t));  // dwMinBitRate, dwMaxBitRate
    // Both kinds have the default interval and one more number, in another order.
    fields.skip(sizeof(std::uint32_t));
    if (!frame_based) {
      fields.skip(sizeof(std::uint32_t));
    }
    const auto count = fields.take<std::uint8_t>();
    if (frame_based) {
      fields.skip(sizeof(std::uint32_t));  // dwBytesPerLine
    }
    for (std::uint8_t i = 0; i < count && fields.ok(); ++i) {
      frame.intervals_100ns.push_back(fields.take<std::uint32_t>());
    }
    auto& formats = found.streams.back().formats;
    if (!formats.empty()) {
      formats.back().frames.push_back(std::move(frame));
    }
  }

  Kind kind_ = Kind::kNone;
};

// wTotalLength, bNumInterfaces
constexpr std::size_t kLengthAndCount = 3;

void collect(Collector& collector, std::uint8_t type, FieldReader& fields) {
  switch (type) {
    case kConfiguration:
      fields.skip(kLengthAndCount);
      collector.found.configuration = fields.take<std::uint8_t>();
      break;
    case kInterface:
      collector.on_interface(fields);
      break;
    case kEndpoint:
      collector.on_endpoint(fields);
      break;
    case kHidClass:
      collector.on_hid(fields);
      break;
    case kClassInterface:
      collector.on_class_interface(fields);
      break;
    default:
      break;
  }
}

}  // namespace

bool ExtensionUnit::has(std::uint8_t selector) const noexcept {
  const std::size_t bit = std::size_t{selector} - 1;
  return selector != 0 && bit / kBitsPerByte < controls.size() &&
         (std::to_integer<unsigned>(controls[bit / kBitsPerByte]) >> (bit % kBitsPerByte) & 1U) !=
             0;
}

Result<UsbDescription> parse_configuration(std::span<const std::byte> bytes) {
  Collector collector;
  std::size_t at = 0;
  while (at < bytes.size()) {
    const auto left = bytes.subspan(at);
    const std::size_t length = std::to_integer<std::size_t>(left[0]);
    if (length < 2 || length > left.size()) {
      return fail(ErrorCode::kInvalidData,
                  "configuration descriptor, byte {}: a length of {} where {} bytes are left", at,
                  length, left.size());
    }
    const auto type = std::to_integer<std::uint8_t>(left[1]);
    FieldReader fields{left.first(length).subspan(2)};
    collect(collector, type, fields);
    if (!fields.ok()) {
      return fail(ErrorCode::kInvalidData,
                  "configuration descriptor, byte {}: a descriptor of type {:#04x} ends after {} "
                  "bytes, before its last field",
                  at, type, length);
    }
    at += length;
  }
  return std::move(collector.found);
}

int rate_of(std::uint32_t interval_100ns) noexcept {
  constexpr std::uint32_t kUnitsPerSecond = 10'000'000;
  return interval_100ns == 0
             ? 0
             : static_cast<int>((kUnitsPerSecond + std::uint64_t{interval_100ns} / 2) /
                                interval_100ns);
}

std::vector<VideoMode> list_modes(const UsbDescription& description) {
  std::vector<VideoMode> modes;
  for (const StreamingInterface& stream : description.streams) {
    for (const UvcFormat& format : stream.formats) {
      if (format.coding == PixelCoding::kOther) {
        continue;
      }
      for (const UvcFrame& frame : format.frames) {
        for (const std::uint32_t interval : frame.intervals_100ns) {
          modes.push_back({format.coding, frame.width, frame.height, rate_of(interval)});
        }
      }
    }
  }
  return modes;
}

std::string describe_modes(const std::vector<VideoMode>& modes, PixelCoding coding) {
  std::map<std::pair<int, int>, std::string> rates;
  for (const VideoMode& mode : modes) {
    if (mode.coding == coding) {
      std::string& text = rates[{mode.width, mode.height}];
      text += fmt::format("{}{}", text.empty() ? "" : "/", mode.rate_hz);
    }
  }
  std::string all;
  for (const auto& [size, text] : rates) {
    all += fmt::format("{}{}x{} at {} Hz", all.empty() ? "" : ", ", size.first, size.second, text);
  }
  return all.empty() ? "none" : all;
}

// Four times its largest, 1920x1080 YUYV: a frame's memory is taken before the first frame comes,
// so corrupt descriptors must not be able to ask for gigabytes.
constexpr std::int64_t kLargestFrameBytes = std::int64_t{4} * 1920 * 1080 * 2;

Result<ModeChoice> choose_mode(const UsbDescription& description, const VideoMode& mode) {
  for (const StreamingInterface& stream : description.streams) {
    for (const UvcFormat& format : stream.formats) {
      for (const UvcFrame& frame : format.frames) {
        const auto interval = std::ranges::find(frame.intervals_100ns, mode.rate_hz, &rate_of);
        if (format.coding != mode.coding || frame.width != mode.width ||
            frame.height != mode.height || interval == frame.intervals_100ns.end()) {
          continue;
        }
        const std::int64_t bytes =
            std::int64_t{frame.width} * frame.height * format.bits_per_pixel / kBitsPerByte;
        if (bytes > kLargestFrameBytes) {
          return fail(ErrorCode::kInvalidData,
                      "format {}, frame {} of the camera's descriptors: {}x{} at {} bits a pixel "
                      "are {} bytes; no mode of this camera has more than {}",
                      format.index, frame.index, frame.width, frame.height, format.bits_per_pixel,
                      bytes, kLargestFrameBytes);
        }
        return ModeChoice{.interface = stream.number,
                          .endpoint = stream.endpoint,
                          .format_index = format.index,
                          .frame_index = frame.index,
                          .interval_100ns = *interval,
                          .frame_bytes = static_cast<std::uint32_t>(bytes)};
      }
    }
  }
  return fail(ErrorCode::kNotFound,
              "the camera has no {} of {}x{} at {} Hz on this link; it has {}",
              mode.coding == PixelCoding::kZ16 ? "depth" : "colour", mode.width, mode.height,
              mode.rate_hz, describe_modes(list_modes(description), mode.coding));
}

}  // namespace geoflow::drivers::d435i
