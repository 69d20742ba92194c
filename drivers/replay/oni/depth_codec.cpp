#include "replay/oni/depth_codec.hpp"

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "fields.hpp"

namespace geoflow::drivers::oni {
namespace {

constexpr unsigned kHalfByte = 4;
constexpr unsigned kByte = 8;
constexpr unsigned kLowHalf = 0x0f;
// A first byte below this is two differences in half bytes; from it on a number of repetitions in
// pairs; at the end one escape for a single value.
constexpr unsigned kRepetitions = 0xe0;
constexpr unsigned kEscape = 0xff;
constexpr unsigned kHalfZero = 6;       // the half byte of difference 0
constexpr unsigned kHalfEscape = 0x0f;  // a whole byte or a value follows
constexpr unsigned kHalfNone = 0x0d;    // there is no second difference
constexpr unsigned kByteDifference = 0x80;
constexpr unsigned kByteZero = 192;

class Decoder {
 public:
  Decoder(std::span<const std::byte> bytes, bool with_table, std::size_t pixels)
      : input_{bytes}, wanted_{pixels} {
    if (with_table) {
      const auto count = input_.take<std::uint16_t>();
      table_.reserve(count);
      for (std::size_t i = 0; i < count && input_.ok(); ++i) {
        table_.push_back(input_.take<std::uint16_t>());
      }
    }
    has_table_ = with_table;
    output_.reserve(pixels);
  }

  [[nodiscard]] Result<std::vector<std::uint16_t>> run() {
    value_ = input_.take<std::uint16_t>();
    put();
    while (input_.ok() && valid_ && !input_.left().empty()) {
      step();
    }
    if (!input_.ok()) {
      return fail(ErrorCode::kInvalidData, "compressed depth is cut off");
    }
    if (!valid_) {
      return fail(ErrorCode::kInvalidData, "compressed depth has an index outside its table");
    }
    if (output_.size() != wanted_ || too_many_) {
      return fail(ErrorCode::kInvalidData, "compressed depth has {}{} pixels where {} belong",
                  too_many_ ? "more than " : "", output_.size(), wanted_);
    }
    return std::move(output_);
  }

 private:
  void step() {
    const unsigned first = input_.take<std::uint8_t>();
    if (first == kEscape) {
      take_wide();
    } else if (first >= kRepetitions) {
      for (unsigned i = 0; i < 2 * (first - kRepetitions); ++i) {
        put();
      }
    } else {
      take_halves(first);
    }
  }

  void take_halves(unsigned halves) {
    change((halves >> kHalfByte) - kHalfZero);
    const unsigned second = halves & kLowHalf;
    if (second == kHalfEscape) {
      take_wide();
    } else if (second != kHalfNone) {
      change(second - kHalfZero);
    }
  }

  /// A difference of a byte, or a value.
  void take_wide() {
    const unsigned first = input_.take<std::uint8_t>();
    if ((first & kByteDifference) != 0) {
      change(first - kByteZero);
      return;
    }
    value_ = static_cast<std::uint16_t>(first << kByte | input_.take<std::uint8_t>());
    put();
  }

  /// Differences are subtracted, modulo 2^16.
  void change(unsigned difference) {
    value_ = static_cast<std::uint16_t>(value_ - difference);
    put();
  }

  void put() {
    if (output_.size() == wanted_) {
      too_many_ = true;
      return;
    }
    if (!has_table_) {
      output_.push_back(value_);
    } else if (value_ < table_.size()) {
      output_.push_back(table_[value_]);
    } else {
      valid_ = false;
    }
  }

  FieldReader input_;
  std::size_t wanted_;
  std::vector<std::uint16_t> table_;
  std::vector<std::uint16_t> output_;
  std::uint16_t value_ = 0;
  bool has_table_ = false;
  bool valid_ = true;
  bool too_many_ = false;
};

}  // namespace

Result<std::vector<std::uint16_t>> decode_depth(std::span<const std::byte> bytes, bool with_table,
                                                std::size_t pixels) {
  return Decoder{bytes, with_table, pixels}.run();
}

}  // namespace geoflow::drivers::oni
