#pragma once

#include <algorithm>
#include <cstring>
#include <optional>
#include <string_view>
#include <type_traits>

#include <OniCTypes.h>

/// Values as they cross OpenNI2's property functions: a pointer and a size. Pure.
namespace geoflow::drivers::openni2 {

/// Writes `value` where the caller has room for it.
template <typename Value>
[[nodiscard]] OniStatus give(const Value& value, void* data, int* size) {
  static_assert(std::is_trivially_copyable_v<Value>);
  if (data == nullptr || size == nullptr || *size < static_cast<int>(sizeof(Value))) {
    return ONI_STATUS_BAD_PARAMETER;
  }
  std::memcpy(data, &value, sizeof(Value));
  *size = static_cast<int>(sizeof(Value));
  return ONI_STATUS_OK;
}

/// Writes `text` with its end, cut off where the room is shorter.
[[nodiscard]] inline OniStatus give_text(std::string_view text, void* data, int* size) {
  if (data == nullptr || size == nullptr || *size < 1) {
    return ONI_STATUS_BAD_PARAMETER;
  }
  const std::size_t count = std::min(text.size(), static_cast<std::size_t>(*size) - 1);
  auto* const target = static_cast<char*>(data);
  std::ranges::copy(text.substr(0, count), target);
  target[count] = '\0';
  *size = static_cast<int>(count + 1);
  return ONI_STATUS_OK;
}

/// Reads a value of exactly that size; none otherwise.
template <typename Value>
[[nodiscard]] std::optional<Value> take(const void* data, int size) {
  static_assert(std::is_trivially_copyable_v<Value>);
  if (data == nullptr || size != static_cast<int>(sizeof(Value))) {
    return std::nullopt;
  }
  Value value{};
  std::memcpy(&value, data, sizeof(Value));
  return value;
}

}  // namespace geoflow::drivers::openni2
