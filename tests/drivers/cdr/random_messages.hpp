#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <list>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include <rapidcheck.h>

#include "replay/cdr/messages.hpp"

/// Random messages of every type: any bit pattern in any number (NaN payloads included), any length
/// of any sequence.
namespace geoflow::drivers::test {

/// Owns the bytes that the messages it fills are views of.
class RandomMessages {
 public:
  template <typename Message>
  Message make() {
    Message message;
    fill(message);
    return message;
  }

 private:
  void fill(bool& value) { value = *rc::gen::arbitrary<bool>(); }
  void fill(std::integral auto& value) {
    value = *rc::gen::arbitrary<std::remove_reference_t<decltype(value)>>();
  }
  void fill(double& value) { value = std::bit_cast<double>(*rc::gen::arbitrary<std::uint64_t>()); }
  void fill(std::string& text) { text = *rc::gen::arbitrary<std::string>(); }
  void fill(std::span<const std::byte>& bytes) {
    const auto& kept = bytes_.emplace_back(*rc::gen::arbitrary<std::vector<std::uint8_t>>());
    bytes = std::as_bytes(std::span{kept});
  }
  template <typename T>
  void fill(std::vector<T>& values) {
    values.resize(*rc::gen::inRange<std::size_t>(0, 6));
    for (T& value : values) {
      fill(value);
    }
  }
  template <typename T, std::size_t Size>
  void fill(std::array<T, Size>& values) {
    for (T& value : values) {
      fill(value);
    }
  }
  template <typename T>
    requires requires(T& value) { T::fields(value); }
  void fill(T& message) {
    std::apply([this](auto&... member) { (this->fill(member), ...); }, T::fields(message));
  }

  std::list<std::vector<std::uint8_t>> bytes_;
};

}  // namespace geoflow::drivers::test
