#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"

namespace geoflow::drivers::can::tests {

/// The dictionary that comes with the program.
[[nodiscard]] const LegDictionary& dictionary();

/// A frame as candump writes it: `110#0CFE9411D8DC0701`.
[[nodiscard]] Frame frame(std::string_view text);

/// A sample whose values tell its number, joint and kind; all legs valid.
[[nodiscard]] LegSample sample_of(std::uint64_t number);

/// The sample's value that a field of the dictionary carries.
[[nodiscard]] double value_of(const LegSample& sample, const LegField& field);

/// Whether two samples are the same within half a step of the shipped dictionary.
[[nodiscard]] bool is_same(const LegSample& a, const LegSample& b);

inline constexpr Duration kRoundPeriod{2'000'000};  ///< of 500 Hz
inline constexpr Duration kFrameTime{130'000};      ///< of a classic frame at 1 Mbit/s

/// The frames of `count` rounds at 500 Hz from `begin` on, numbered from `first`, one kFrameTime
/// after another, each of sample_of(its number). Device time is 2 ms times the number.
[[nodiscard]] std::vector<Received> rounds(std::uint64_t first, std::uint64_t count, HostTime begin,
                                           bool fd = false);

}  // namespace geoflow::drivers::can::tests
