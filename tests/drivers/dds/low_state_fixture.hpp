#pragma once

#include <cstdint>

#include "dds/low_state.hpp"

namespace geoflow::drivers::dds::tests {

/// A message whose every value differs from its neighbours and tells the message's number; tick is
/// 2 ms times it, the checksum is right.
[[nodiscard]] LowState low_state(std::uint32_t number);

}  // namespace geoflow::drivers::dds::tests
