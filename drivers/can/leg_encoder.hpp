#pragma once

#include <cstdint>
#include <vector>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"

namespace geoflow::drivers::can {

/// What legs would put on the bus: the counterpart of SnapshotAssembler, for emulation and tests.
/// Pure; `dictionary` must outlive it.
class LegEncoder {
 public:
  /// `fd`: by the dictionary's CAN FD frames of the legs, else by its classic ones.
  LegEncoder(const LegDictionary& dictionary, bool fd) : dictionary_{dictionary}, fd_{fd} {}

  /// The frames of one round in the order of a bus: SYNC if there is one, then by identifier. Legs
  /// that are not valid are silent. `device_time` >= 0 and `round` wrap as their signals do. Values
  /// are kept within what their bits can hold.
  [[nodiscard]] std::vector<Frame> encode(const LegSample& sample, std::uint64_t round,
                                          Duration device_time) const;

 private:
  const LegDictionary& dictionary_;
  bool fd_;
};

}  // namespace geoflow::drivers::can
