#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/faults/script.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::faults {

/// One fault at work on the events that pass. Thread-bound; deterministic by its seed.
class Stage {
 public:
  Stage() = default;
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;
  virtual ~Stage() = default;

  /// Appends what becomes of `event` to `out`: nothing, itself, more.
  virtual void apply(Event event, std::vector<Event>& out) = 0;

  /// Appends what was held back, at the end of the recording.
  virtual void finish(std::vector<Event>& /*out*/) {}
};

/// What a stage needs besides its fault. `counters` outlives it.
struct StageContext {
  HostTime start;  ///< of the recording
  std::uint64_t seed = 0;
  FaultCounters* counters = nullptr;
};

[[nodiscard]] std::unique_ptr<Stage> make_stage(const Fault& fault, const StageContext& context);

/// The stages of the clock faults, which act on device times; arrival stays the original stamp.
[[nodiscard]] std::unique_ptr<Stage> make_clock_stage(const Fault& fault,
                                                      const StageContext& context);

[[nodiscard]] bool is_clock_fault(FaultKind kind) noexcept;

/// The period of a 32-bit counter of microseconds.
inline constexpr Duration kWrapPeriod = std::chrono::microseconds{std::int64_t{1} << 32U};

}  // namespace geoflow::drivers::faults
