#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>

#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/descriptors.hpp"

namespace geoflow::emulator {
namespace {

/// wDescriptorLength of a D455 (firmware 5.14) and a D436 (5.17).
constexpr std::size_t kDescriptorLength = 1000;

// NOLINTBEGIN(readability-magic-numbers): usages of HID 1.11 and of the HID Sensor Usages, page
// 0x20, each by its name

/// Items of a report descriptor (HID 1.11, 6.2.2). Global items hold until they are said anew, and
/// are left out where they hold already.
class Items {
 public:
  void begin_collection(std::uint8_t kind) { to_.u8(0xa1).u8(kind); }
  void end_collection() { to_.u8(0xc0); }
  void sensor_page() { to_.u8(0x05).u8(0x20); }
  void usage(std::uint16_t value) { to_.u8(0x0a).u16(value); }
  void report(std::uint8_t id) { to_.u8(0x85).u8(id); }
  /// A field of one value; signed where `minimum` < 0.
  void range(std::int32_t minimum, std::int32_t maximum) {
    global(0x14, minimum);
    global(0x24, maximum);
  }
  void size(std::uint8_t bits) {
    global(0x74, bits);
    global(0x94, 1);
  }
  /// Power of ten of the unit, which is the one that a usage has where no unit is given.
  void exponent(int power) { global(0x54, power & 0x0f); }
  void field(bool input, std::uint8_t flags) { to_.u8(input ? 0x81 : 0xb1).u8(flags); }
  ByteWriter& bytes() { return to_; }

 private:
  /// In the fewest bytes that keep the value's sign.
  void global(std::uint8_t tag, std::int32_t value) {
    const auto [known, added] = globals_.try_emplace(tag, value);
    if (!added && std::exchange(known->second, value) == value) {
      return;
    }
    if (value == static_cast<std::int8_t>(value)) {
      to_.u8(tag | 1U).put(static_cast<std::int8_t>(value));
    } else if (value == static_cast<std::int16_t>(value)) {
      to_.u8(tag | 2U).put(static_cast<std::int16_t>(value));
    } else {
      to_.u8(tag | 3U).put(value);
    }
  }

  std::map<std::uint8_t, std::int32_t> globals_;
  ByteWriter to_;
};

constexpr std::uint8_t kPhysical = 0;
constexpr std::uint8_t kApplication = 1;
constexpr std::uint8_t kLogical = 2;
constexpr std::uint8_t kArray = 0;
constexpr std::uint8_t kVariable = 2;

/// A choice of `count` named values, numbered from 1, in one byte.
void put_choice(Items& items, bool input, std::uint16_t property, std::uint16_t first,
                std::uint8_t count) {
  items.usage(property);
  items.range(1, count);
  items.size(8);
  items.exponent(0);
  items.begin_collection(kLogical);
  for (std::uint16_t i = 0; i < count; ++i) {
    items.usage(static_cast<std::uint16_t>(first + i));
  }
  items.field(input, kArray);
  items.end_collection();
}

void put_value(Items& items, bool input, std::uint16_t property, std::uint8_t bits) {
  items.usage(property);
  items.range(0, bits == 8 ? 0xff : bits == 16 ? 0xffff : 0x7fffffff);
  items.size(bits);
  items.exponent(0);
  items.field(input, kVariable);
}

void put_state(Items& items, bool input) {
  put_choice(items, input, 0x0201, 0x0800, 7);
}

void put_feature_report(Items& items) {
  put_choice(items, false, 0x0309, 0x0830, 3);  // connection type
  put_state(items, false);
  put_choice(items, false, 0x0319, 0x0850, 6);  // power state
  put_value(items, false, 0x0304, 8);           // minimum report interval
  put_value(items, false, 0x030e, 16);          // report interval [ms]
  put_value(items, false, 0x030f, 16);          // change sensitivity
}

void put_timestamp(Items& items) {
  items.usage(0x0529);
  items.range(0, 0x7fffffff);
  items.size(64);
  items.exponent(-6);
  items.field(true, kVariable);
}

void put_axes(Items& items, std::uint16_t first_axis, int exponent, bool wide) {
  for (std::uint16_t axis = 0; axis < 3; ++axis) {
    items.usage(static_cast<std::uint16_t>(first_axis + axis));
    items.range(wide ? INT32_MIN : INT16_MIN, wide ? INT32_MAX : INT16_MAX);
    items.size(wide ? 32 : 16);
    items.exponent(exponent);
    items.field(true, kVariable);
  }
}

/// Custom values 1 to 7: two of 32 bits, three of 16, two of 8 (the IMU's and the USB side's
/// counters).
void put_custom_values(Items& items) {
  constexpr std::uint16_t kFirst = 0x0544;
  for (std::uint16_t i = 0; i < 7; ++i) {
    put_value(items, true, static_cast<std::uint16_t>(kFirst + i), i < 2 ? 32 : i < 5 ? 16 : 8);
  }
}

void begin_sensor(Items& items, std::uint8_t report, std::uint16_t usage) {
  items.usage(usage);
  items.begin_collection(kPhysical);
  items.report(report);
  put_feature_report(items);
  put_state(items, true);
  put_timestamp(items);
}

void put_motion_sensor(Items& items, std::uint8_t report, bool wide) {
  const bool accelerometer = report == 1;
  const int gyroscope_exponent = wide ? -4 : -1;
  begin_sensor(items, report, accelerometer ? 0x0073 : 0x0076);
  put_axes(items, accelerometer ? 0x0453 : 0x0457, accelerometer ? -3 : gyroscope_exponent, wide);
  put_custom_values(items);
  items.end_collection();
}

void begin_application(Items& items) {
  items.sensor_page();
  items.usage(0x0001);
  items.begin_collection(kApplication);
}

}  // namespace

Bytes hid_report_descriptor(bool wide) {
  Items items;
  begin_application(items);
  put_motion_sensor(items, 1, wide);
  put_motion_sensor(items, 2, wide);
  items.end_collection();
  begin_application(items);
  begin_sensor(items, 3, 0x00e1);
  put_custom_values(items);
  items.end_collection();
  // To the length that real cameras have, by items that say again what holds already.
  ByteWriter& to = items.bytes();
  if ((kDescriptorLength - to.size()) % 2 == 0) {
    to.u8(0x54);  // a unit exponent of 0
  }
  while (to.size() + 1 < kDescriptorLength) {
    items.sensor_page();
  }
  items.end_collection();
  return to.take();
}

// NOLINTEND(readability-magic-numbers)

}  // namespace geoflow::emulator
