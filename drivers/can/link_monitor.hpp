#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/snapshot.hpp"

namespace geoflow::drivers::can {

/// What is wrong with the legs' bus, the worst first.
enum class LinkTrouble : std::uint8_t {
  kNone,
  kNoInterface,   ///< it cannot be opened or read
  kBusOff,        ///< the controller has taken itself off the bus
  kForeignOnly,   ///< frames come, but none of the dictionary's
  kSilent,        ///< nothing comes
  kOverflow,      ///< the kernel dropped frames
  kMissingLeg,    ///< a leg is silent
  kOutOfStep,     ///< a leg's counter is not SYNC's
  kErrorPassive,  ///< the controller counts many errors
};

struct LinkReport {
  LinkTrouble trouble = LinkTrouble::kNone;
  SourceState state = SourceState::kStreaming;
  std::string reason;  ///< a sentence, empty while all is well
};

/// Tells from frames and error reports how the legs' bus is, in words. Time is an argument;
/// thread-bound.
class LinkMonitor {
 public:
  // NOLINTBEGIN(readability-magic-numbers): each is named by its member
  /// A leg, or the whole bus, that is not heard for so long is reported: ten rounds at 200 Hz.
  static constexpr Duration kSilence = std::chrono::milliseconds{50};
  /// So long a trouble is reported after it was last seen.
  static constexpr Duration kMemory = std::chrono::seconds{1};
  // NOLINTEND(readability-magic-numbers)

  /// `interfaces` by their names; `dictionary` must outlive this.
  LinkMonitor(const LegDictionary& dictionary, std::vector<std::string> interfaces);

  void opened(HostTime now);
  /// It could not be opened, or not be read any more.
  void failed(const Error& error);
  /// A frame, with what the dictionary says of it (kForeign for an error report).
  void on_frame(const Received& received, FrameKind kind);
  /// The kernel's count of dropped frames so far.
  void on_overflow(std::uint64_t dropped, HostTime now);

  [[nodiscard]] LinkReport assess(HostTime now, const SnapshotAssembler& assembler) const;
  /// True when nothing known comes, so that it is worth listening to what else does.
  [[nodiscard]] bool is_silent(HostTime now) const;

 private:
  void on_error_report(const Received& received);
  [[nodiscard]] std::string bus_name(std::uint8_t bus) const;
  [[nodiscard]] LinkReport silence(HostTime now) const;
  [[nodiscard]] std::optional<LinkReport> missing_legs(HostTime now,
                                                       const SnapshotAssembler& assembler) const;

  /// A trouble that came at one instant.
  struct Event {
    HostTime t;
    std::string what;
  };

  static constexpr std::size_t kForeignNamed = 4;

  const LegDictionary& dictionary_;
  std::vector<std::string> interfaces_;
  std::optional<std::string> failure_;
  std::optional<std::string> bus_off_;
  HostTime listening_since_;
  std::optional<HostTime> last_known_;
  std::optional<HostTime> last_foreign_;
  std::optional<HostTime> last_too_short_;
  std::vector<std::string> foreign_;  // identifiers, the first few since frames were known
  std::optional<Event> overflow_;
  std::optional<Event> error_passive_;
  std::uint64_t dropped_ = 0;
};

}  // namespace geoflow::drivers::can
