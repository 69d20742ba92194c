#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"

namespace geoflow::drivers::can {

// NOLINTBEGIN(readability-magic-numbers): each is named by its member
/// How long frames are waited for. A round of samples is 2 to 5 ms long (500 to 200 Hz).
struct AssemblyConfig {
  /// A group of values that was not heard for so long is not waited for until it is heard again.
  Duration silent_after = std::chrono::milliseconds{20};
  /// A snapshot goes out incomplete so long after its first frame.
  Duration most_wait = std::chrono::milliseconds{20};
  /// After a silence of the whole bus this long, counters are taken to have begun anew.
  Duration restart_after = std::chrono::milliseconds{100};
};
// NOLINTEND(readability-magic-numbers)

/// What became of frames and rounds. Each frame of a leg counts in at most one of `duplicate`,
/// `late`, `out_of_step` and `unattributed`.
struct AssemblyCounters {
  std::uint64_t snapshots = 0;     ///< emitted
  std::uint64_t incomplete = 0;    ///< of these, with a leg that is not valid
  std::uint64_t empty = 0;         ///< rounds of which no leg was whole: not emitted
  std::uint64_t unplaced = 0;      ///< rounds whose device time nothing tells: not emitted
  std::uint64_t gaps = 0;          ///< rounds of which nothing was heard, by their counter
  std::uint64_t duplicate = 0;     ///< frames with values that their round has already
  std::uint64_t late = 0;          ///< frames of a round that is out
  std::uint64_t out_of_step = 0;   ///< frames whose counter is ahead of SYNC's
  std::uint64_t unattributed = 0;  ///< frames without a counter whose leg's round is not known
  std::uint64_t too_short = 0;     ///< frames shorter than the dictionary says
  std::uint64_t implausible = 0;   ///< values out of the dictionary's range
  std::uint64_t restarts = 0;      ///< of the counter
};

/// Makes snapshots of all legs from single frames.
///
/// **With counters** (`FR_seq`, SYNC's `seq`): a frame belongs to the round that its counter says;
/// one without a counter to the round of its leg's last frame with one (a node sends its frames of
/// a round one after another). Two rounds are open at once, so that frames of two buses may
/// overlap. SYNC's time is the sample's device time; a round whose SYNC was lost is placed by the
/// ones before it.
///
/// **Without** (actuators that answer one after another): a round begins with the first value that
/// the one before has already. Its instant is the middle of its frames' arrivals.
///
/// A snapshot goes out when all groups of values that are alive are in; else when the second round
/// after it begins, or after most_wait. A leg is valid if angle and rate of its three joints were
/// heard. Snapshots leave in the order of their rounds, at most one of each. Time is an argument;
/// deterministic; thread-bound.
class SnapshotAssembler {
 public:
  /// `dictionary` must outlive this.
  explicit SnapshotAssembler(const LegDictionary& dictionary, const AssemblyConfig& config = {});

  /// Takes the next frame in order of arrival and says what it was.
  FrameKind push(const Received& received);
  /// The next snapshot that is complete, or whose wait is over at `now`. Call until it gives none.
  [[nodiscard]] std::optional<Arrival<LegClock, LegSample>> pop(HostTime now);
  /// At the end of the frames: makes pop() give all that is left.
  void finish();

  /// SYNC's clock and its period where the dictionary has one; else the host's.
  [[nodiscard]] StampInfo stamps() const;
  [[nodiscard]] const AssemblyCounters& counters() const noexcept { return counters_; }
  /// When the leg's values last came; none: not yet.
  [[nodiscard]] std::optional<HostTime> last_heard(Leg leg) const noexcept {
    return leg_heard_[static_cast<std::size_t>(leg)];
  }
  /// When a frame of the leg was last refused because its counter is not SYNC's; none: never.
  [[nodiscard]] std::optional<HostTime> last_out_of_step(Leg leg) const noexcept {
    return leg_out_of_step_[static_cast<std::size_t>(leg)];
  }

 private:
  static constexpr std::size_t kJointCount = kLegCount * kJointsPerLeg;

  /// A round that frames may still belong to.
  struct Round {
    std::int64_t number = 0;
    HostTime t_first;
    HostTime t_last;
    std::optional<HostTime> t_sync{};
    std::optional<Duration> device_time{};
    LegSample sample{};
    std::array<bool, kJointCount> has_angle{};
    std::array<bool, kJointCount> has_rate{};
    std::vector<bool> heard{};  // by group
  };

  struct PlacedRound {
    std::int64_t number = 0;
    Duration device_time{};
  };

  void restart(HostTime t);
  [[nodiscard]] bool take_sync(const Received& received);
  [[nodiscard]] bool take_values(std::size_t group, const Received& received);
  [[nodiscard]] Round* counted_round(std::size_t group, const Received& received);
  [[nodiscard]] Round* arriving_round(std::size_t group, HostTime t);
  [[nodiscard]] Round& open_round(std::int64_t number, HostTime t);
  void fill(Round& round, const FieldGroup& group, const Frame& frame);
  [[nodiscard]] std::int64_t unwrapped(std::uint64_t counter, std::size_t bits) const noexcept;
  [[nodiscard]] bool is_complete(const Round& round, HostTime now) const;
  void close_front();
  void emit(Round& round);
  [[nodiscard]] std::optional<Duration> device_time_of(const Round& round) const;

  const LegDictionary& dictionary_;
  AssemblyConfig config_;
  bool counted_ = false;  // the dictionary has counters
  AssemblyCounters counters_;
  std::optional<HostTime> last_accepted_;  // a frame that found its round
  std::vector<std::optional<HostTime>> group_heard_;
  std::array<std::optional<HostTime>, kLegCount> leg_heard_{};
  std::array<std::optional<HostTime>, kLegCount> leg_out_of_step_{};
  std::array<std::optional<std::int64_t>, kLegCount> leg_round_{};  // of its last counter
  std::optional<std::int64_t> newest_;                              // round begun
  std::optional<std::int64_t> newest_sync_;                         // round begun by SYNC
  std::optional<std::int64_t> closed_;                              // newest round that is out
  std::optional<PlacedRound> placed_;  // newest round that a SYNC has placed
  Duration round_period_{};            // between rounds, from the last two SYNCs
  std::deque<Round> open_;             // by number
  std::deque<Arrival<LegClock, LegSample>> ready_;
};

}  // namespace geoflow::drivers::can
