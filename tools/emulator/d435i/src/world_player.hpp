#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/world.hpp"

namespace geoflow::emulator {

/// Gives a world's samples when their time has come. The world's time stands still while it is
/// paused, as it is at first.
class WorldPlayer {
 public:
  explicit WorldPlayer(std::unique_ptr<World> world) noexcept : world_{std::move(world)} {}

  [[nodiscard]] const Calibration& calibration() const { return world_->calibration(); }
  /// `now` may be earlier than the newest sample: then the world pauses at that one.
  void run(bool running, HostTime now) noexcept;
  /// The next sample whose time has come, or none.
  [[nodiscard]] std::optional<WorldSample> next(HostTime now);
  /// When next() has the next one; HostTime::max() while paused and at the end.
  [[nodiscard]] HostTime next_due();
  /// When the host's clock showed, or will, a time of the world's; only while it runs.
  [[nodiscard]] HostTime host_time(Duration t) const noexcept { return start_ + t; }
  /// The host's time less the recording's, by the newest sample; none before the first.
  [[nodiscard]] std::optional<Duration> recording_shift() const noexcept { return shift_; }
  [[nodiscard]] std::uint64_t errors() const noexcept { return errors_; }

 private:
  void look_ahead();

  std::unique_ptr<World> world_;
  std::optional<WorldSample> ahead_;
  bool ended_ = false;
  bool running_ = false;
  HostTime start_{};      ///< of the world, while it runs
  Duration paused_at_{};  ///< on the world's time line
  Duration newest_{};     ///< when the newest sample was sent, likewise
  std::optional<Duration> shift_{};
  std::uint64_t errors_ = 0;
};

}  // namespace geoflow::emulator
