#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "replay/faults/script.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::faults {

/// `inner` with the faults put on each of its events in the script's order (a clock's wrap last),
/// and the events in order of their arrival again. A clock fault makes its clock's stamps
/// StampDomain::kDevice. The same script, seed and recording give the same events.
[[nodiscard]] std::unique_ptr<RecordingReader> with_faults(std::unique_ptr<RecordingReader> inner,
                                                           const std::vector<Fault>& faults,
                                                           std::uint64_t seed);

}  // namespace geoflow::drivers::faults
