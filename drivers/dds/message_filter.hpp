#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "dds/low_state.hpp"

namespace geoflow::drivers::dds {

/// What became of messages.
struct MessageCounters {
  std::uint64_t accepted = 0;
  std::uint64_t malformed = 0;   ///< of a wrong length, or with a value that is no number
  std::uint64_t damaged = 0;     ///< with a wrong checksum, from a sender whose are right
  std::uint64_t unchecked = 0;   ///< with a wrong checksum, accepted: the sender's never were right
  std::uint64_t duplicates = 0;  ///< with the tick, or all values, of the one before
  std::uint64_t lost = 0;        ///< that never came, by their tick
  std::uint64_t restarts = 0;    ///< of the robot's clock
};

/// What one message says.
struct RobotSample {
  Arrival<LegClock, LegSample> legs;
  Arrival<ImuClock, ImuSample> imu;
};

/// Turns messages into samples, and tells how the stream of them is. Time is an argument;
/// thread-bound.
class MessageFilter {
 public:
  // NOLINTBEGIN(readability-magic-numbers): each is named by its member
  /// The stream is silent after so long: 50 messages of 500 a second.
  static constexpr Duration kSilence = std::chrono::milliseconds{100};
  /// So long a trouble is reported after it was last seen.
  static constexpr Duration kMemory = std::chrono::seconds{1};
  /// Messages with the values of the one before are dropped for so long; then the robot is taken
  /// to stand as still as that.
  static constexpr Duration kLongestRepetition = std::chrono::milliseconds{50};
  /// The tick's period: 2^32 ms.
  static constexpr Duration kTickPeriod = std::chrono::milliseconds{std::int64_t{1} << 32U};
  // NOLINTEND(readability-magic-numbers)

  /// `where` names topic, domain and interface in sentences.
  explicit MessageFilter(std::string where) : where_{std::move(where)} {}

  /// Listening begins, or begins again.
  void opened(HostTime now);
  void failed(const Error& error) { failure_ = error.message; }

  /// Takes one message in CDR; none where it is dropped, which is counted.
  [[nodiscard]] std::optional<RobotSample> take(std::span<const std::byte> cdr, HostTime t_arrival);

  struct Report {
    SourceState state = SourceState::kStreaming;
    std::string reason;  ///< a sentence, empty while all is well
  };
  /// `writers`: how many writers of the topic are known.
  [[nodiscard]] Report assess(HostTime now, std::uint32_t writers) const;
  [[nodiscard]] const MessageCounters& counters() const noexcept { return counters_; }

 private:
  [[nodiscard]] bool is_intact(const LowState& state, HostTime now);
  [[nodiscard]] bool is_duplicate(const LowState& state, HostTime now);
  void watch_tick(std::uint32_t tick, HostTime now);
  void note(HostTime now, std::string what);

  struct Trouble {
    HostTime t;
    std::string what;
  };

  std::string where_;
  MessageCounters counters_;
  std::optional<std::string> failure_;
  HostTime listening_since_;
  std::optional<HostTime> last_accepted_;
  std::optional<LowState> last_;
  std::optional<HostTime> changed_;  // when values last differed from the message before
  double step_ms_ = 0;               // usual distance of ticks; 0: not known yet
  bool sums_were_right_ = false;
  std::optional<Trouble> trouble_;  // the newest
};

}  // namespace geoflow::drivers::dds
