#include "src/uvc_controls.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/descriptors.hpp"

namespace geoflow::emulator {
namespace {

constexpr unsigned kByteBits = 8;

/// Whether a control is one number whose range is checked, or bytes with a meaning of their own.
enum class Kind : std::uint8_t { kSigned, kUnsigned, kBytes, kReadOnly };

struct Row {
  std::uint8_t interface = 0;
  std::uint8_t entity = 0;
  std::uint8_t selector = 0;
  std::uint8_t size = 0;  ///< [bytes]
  Kind kind = Kind::kUnsigned;
  std::int32_t minimum = 0;
  std::int32_t maximum = 0;
  std::int32_t step = 1;
  std::int32_t fallback = 0;
};

// Ranges of the depth unit's gain, laser and exposure: librealsense's driver for MIPI cameras. The
// colour ones: what librealsense shows of a D435i. Extension selectors 5, 12, 13 and 16 are
// announced by the camera, but nobody knows what they mean.
constexpr std::array kRows{
    Row{0, 1, 0x14, 10, Kind::kBytes},                        // region of interest
    Row{0, 2, 0x04, 2, Kind::kUnsigned, 16, 248, 1, 16},      // gain
    Row{0, 3, 0x02, 1, Kind::kUnsigned, 0, 2, 1, 1},          // emitter: off, on, auto
    Row{0, 3, 0x03, 4, Kind::kUnsigned, 1, 165000, 1, 8500},  // exposure [us]
    Row{0, 3, 0x04, 2, Kind::kUnsigned, 0, 360, 30, 150},     // laser power [mW]
    Row{0, 3, 0x05, 1, Kind::kUnsigned, 0, 0xff},
    Row{0, 3, 0x06, 1, Kind::kUnsigned, 0, 6},        // preset
    Row{0, 3, 0x07, 1, Kind::kReadOnly, 0, 0xff},     // error
    Row{0, 3, 0x08, 1, Kind::kUnsigned, 0, 1},        // trigger out
    Row{0, 3, 0x09, 4, Kind::kReadOnly},              // temperatures
    Row{0, 3, 0x0b, 1, Kind::kUnsigned, 0, 1, 1, 1},  // auto exposure
    Row{0, 3, 0x0c, 1, Kind::kUnsigned, 0, 0xff},
    Row{0, 3, 0x0d, 1, Kind::kUnsigned, 0, 0xff},
    Row{0, 3, 0x0f, 1, Kind::kUnsigned, 0, 1},                  // thermal compensation
    Row{0, 3, 0x10, 1, Kind::kUnsigned, 0, 0xff},               // emitter frequency
    Row{3, 6, 0x02, 1, Kind::kBytes, 1, 8, 9, 8},               // auto exposure mode: a bitmap
    Row{3, 6, 0x03, 1, Kind::kUnsigned, 0, 1},                  // auto exposure priority
    Row{3, 6, 0x04, 4, Kind::kUnsigned, 1, 10000, 1, 156},      // exposure [100 us]
    Row{3, 7, 0x01, 2, Kind::kUnsigned, 0, 1},                  // backlight compensation
    Row{3, 7, 0x02, 2, Kind::kSigned, -64, 64},                 // brightness
    Row{3, 7, 0x03, 2, Kind::kUnsigned, 0, 100, 1, 50},         // contrast
    Row{3, 7, 0x04, 2, Kind::kUnsigned, 0, 128, 1, 64},         // gain
    Row{3, 7, 0x05, 1, Kind::kUnsigned, 0, 3, 1, 3},            // power line frequency
    Row{3, 7, 0x06, 2, Kind::kSigned, -180, 180},               // hue
    Row{3, 7, 0x07, 2, Kind::kUnsigned, 0, 100, 1, 64},         // saturation
    Row{3, 7, 0x08, 2, Kind::kUnsigned, 0, 100, 1, 50},         // sharpness
    Row{3, 7, 0x09, 2, Kind::kUnsigned, 100, 500, 1, 300},      // gamma
    Row{3, 7, 0x0a, 2, Kind::kUnsigned, 2800, 6500, 10, 4600},  // white balance [K]
    Row{3, 7, 0x0b, 1, Kind::kUnsigned, 0, 1, 1, 1},            // white balance, automatic
    Row{3, 8, 0x01, 1, Kind::kUnsigned, 0, 0xff},
    Row{3, 8, 0x02, 1, Kind::kUnsigned, 0, 0xff},
};

constexpr std::uint8_t kErrorCodeControl = 0x02;  // of the interface itself

Bytes number(std::int64_t value, std::size_t size) {
  Bytes bytes = ByteWriter{}.put(value).take();
  bytes.resize(size);
  return bytes;
}

std::int64_t number_of(std::span<const std::byte> bytes, bool is_signed) {
  std::uint64_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;) {
    value = (value << kByteBits) | std::to_integer<std::uint64_t>(bytes[i]);
  }
  const std::uint64_t sign = std::uint64_t{1} << (bytes.size() * kByteBits - 1);
  if (is_signed && (value & sign) != 0) {
    value |= ~(sign - 1);
  }
  return static_cast<std::int64_t>(value);
}

}  // namespace

UvcControls::UvcControls() {
  for (std::size_t row = 0; row < kRows.size(); ++row) {
    values_.push_back({row, number(kRows[row].fallback, kRows[row].size)});
  }
}

const UvcControls::Value* UvcControls::find(std::uint8_t entity, std::uint8_t selector) const {
  const auto found = std::find_if(values_.begin(), values_.end(), [&](const Value& value) {
    return kRows[value.row].entity == entity && kRows[value.row].selector == selector;
  });
  return found == values_.end() ? nullptr : &*found;
}

UvcControls::Value* UvcControls::find(std::uint8_t entity, std::uint8_t selector) {
  return const_cast<Value*>(std::as_const(*this).find(entity, selector));
}

std::optional<Bytes> UvcControls::refuse(UvcError error) {
  last_error_ = error;
  return std::nullopt;
}

std::optional<Bytes> UvcControls::get(const Value& control, UvcRequest request) const {
  const Row& row = kRows[control.row];
  switch (request) {
    case UvcRequest::kGetCur:
      return control.bytes;
    case UvcRequest::kGetMin:
      return number(row.minimum, row.size);
    case UvcRequest::kGetMax:
      return number(row.maximum, row.size);
    case UvcRequest::kGetRes:
      return number(row.step, row.size);
    case UvcRequest::kGetDef:
      return number(row.fallback, row.size);
    case UvcRequest::kGetLen:
      return number(row.size, sizeof(std::uint16_t));
    case UvcRequest::kGetInfo:
      return number(row.kind == Kind::kReadOnly ? 1 : 3, 1);
    default:
      return std::nullopt;
  }
}

bool UvcControls::store(Value& control, std::span<const std::byte> out) {
  const Row& row = kRows[control.row];
  if (row.kind == Kind::kReadOnly || out.size() != row.size) {
    last_error_ = UvcError::kInvalidRequest;
    return false;
  }
  if (row.kind != Kind::kBytes) {
    const std::int64_t value = number_of(out, row.kind == Kind::kSigned);
    if (value < row.minimum || value > row.maximum) {
      last_error_ = UvcError::kOutOfRange;
      return false;
    }
  }
  control.bytes.assign(out.begin(), out.end());
  return true;
}

std::optional<Bytes> UvcControls::request(const SetupPacket& setup,
                                          std::span<const std::byte> out) {
  const auto interface = static_cast<std::uint8_t>(setup.index);
  const auto entity = static_cast<std::uint8_t>(setup.index >> kByteBits);
  const auto selector = static_cast<std::uint8_t>(setup.value >> kByteBits);
  const auto request = static_cast<UvcRequest>(setup.request);
  if (entity == 0) {
    if (selector != kErrorCodeControl || request != UvcRequest::kGetCur) {
      return refuse(UvcError::kInvalidControl);
    }
    return number(static_cast<std::int64_t>(std::exchange(last_error_, UvcError::kNone)), 1);
  }
  Value* control = find(entity, selector);
  if (control == nullptr || kRows[control->row].interface != interface) {
    const bool known = std::any_of(kRows.begin(), kRows.end(), [&](const Row& row) {
      return row.entity == entity && row.interface == interface;
    });
    return refuse(known ? UvcError::kInvalidControl : UvcError::kInvalidUnit);
  }
  if (request == UvcRequest::kSetCur) {
    return store(*control, out) ? std::optional{Bytes{}} : std::nullopt;
  }
  auto answer = get(*control, request);
  return answer ? answer : refuse(UvcError::kInvalidRequest);
}

std::int64_t UvcControls::value(std::uint8_t entity, std::uint8_t selector) const {
  const Value* control = find(entity, selector);
  return control == nullptr ? 0
                            : number_of(control->bytes, kRows[control->row].kind == Kind::kSigned);
}

std::int64_t UvcControls::value(DepthSelector selector) const {
  return value(kDepthExtension, static_cast<std::uint8_t>(selector));
}

void UvcControls::set(DepthSelector selector, std::int64_t value) {
  if (Value* control = find(kDepthExtension, static_cast<std::uint8_t>(selector))) {
    control->bytes = number(value, kRows[control->row].size);
  }
}

}  // namespace geoflow::emulator
