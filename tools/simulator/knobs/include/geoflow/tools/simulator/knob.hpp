#pragma once

#include <algorithm>
#include <span>
#include <string_view>
#include <type_traits>
#include <variant>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

/// The simulator's knobs: each room's options (scene, camera, robot, sensors) list theirs in one
/// constant table, and `simulate --set NAME=VALUE` and `--list` work on the tables alone.
namespace geoflow::simulator {

/// A knob without the type of the options it belongs to, for lists and messages.
struct KnobInfo {
  std::string_view name;  ///< unique over all rooms: "camera.depth_noise_scale"
  std::string_view unit;  ///< "m", "1" for a ratio, "" for a count or a switch
  std::string_view summary;
  double minimum = 0;
  double maximum = 0;
  double fallback = 0;  ///< the default; a switch is 0 or 1
  bool whole = false;   ///< takes whole numbers only
};

/// Binds a name to a member of `Options`. Its default is the member's in `Options{}`.
template <typename Options>
struct Knob {
  std::string_view name;
  std::string_view unit;
  std::string_view summary;
  std::variant<double Options::*, int Options::*, bool Options::*> member;
  double minimum = 0;
  double maximum = 0;
};

/// `text` as a number that `knob` takes. Errors (kInvalidArgument) name the knob, the text and the
/// range.
[[nodiscard]] Result<double> parse_knob_value(const KnobInfo& knob, std::string_view text);

/// The value of a knob in `options`, a switch as 0 or 1.
template <typename Options>
[[nodiscard]] double knob_value(const Knob<Options>& knob, const Options& options) {
  return std::visit([&](auto member) { return static_cast<double>(options.*member); }, knob.member);
}

template <typename Options>
[[nodiscard]] KnobInfo describe(const Knob<Options>& knob) {
  // Static: GCC 12 takes members of types that no knob has for uninitialised in a temporary.
  static const Options defaults{};
  return {.name = knob.name,
          .unit = knob.unit,
          .summary = knob.summary,
          .minimum = knob.minimum,
          .maximum = knob.maximum,
          .fallback = knob_value(knob, defaults),
          .whole = !std::holds_alternative<double Options::*>(knob.member)};
}

/// Sets one knob of `options` from text. True if the table has that name, false if it has not; a
/// wrong value is the error of parse_knob_value().
template <typename Options>
[[nodiscard]] Result<bool> set_knob(std::span<const Knob<Options>> table, std::string_view name,
                                    std::string_view text, Options& options) {
  const auto found = std::ranges::find(table, name, &Knob<Options>::name);
  if (found == table.end()) {
    return false;
  }
  const Result<double> value = parse_knob_value(describe(*found), text);
  if (!value) {
    return tl::unexpected{value.error()};
  }
  std::visit(
      [&](auto member) {
        using Value = std::remove_reference_t<decltype(options.*member)>;
        options.*member = static_cast<Value>(*value);
      },
      found->member);
  return true;
}

}  // namespace geoflow::simulator
