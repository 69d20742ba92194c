#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/dbc/database.hpp"
#include "can/dbc/signal.hpp"
#include "can/frame.hpp"

/// A CAN database read as a dictionary of the legs. Signals say by their names what they are:
///
///     FR_hip_q, FR_thigh_dq, FR_calf_tau, …   angle [rad], rate [rad/s], torque [Nm] of a joint
///     FR_foot_force                           force of a foot, counts or N
///     FR_seq                                  which round of samples the leg's values are of
///     seq, time… [s] in a message SYNC        the round that begins now, and the device's clock
///
/// with FR, FL, RR, RL for the leg. Each joint needs an angle and a rate; all else may be missing.
/// One value may stand in several messages (a classic and an FD frame): either is taken.
namespace geoflow::drivers::can {

enum class Quantity : std::uint8_t { kAngle, kRate, kTorque, kFootForce };

/// Where one value of a LegSample is found.
struct LegField {
  Quantity quantity = Quantity::kAngle;
  std::size_t index = 0;  ///< of the joint in LegSample::joints, or of the leg for kFootForce
  dbc::Signal signal;
};

/// The values that come together: of one message, or of one multiplexed part of it.
struct FieldGroup {
  std::string name;  ///< of the message, for people
  std::uint32_t id = 0;
  bool extended = false;
  bool fd = false;
  std::size_t length = 0;  ///< a frame must be at least so long [B]
  Leg leg = Leg::kFrontRight;
  std::optional<dbc::Signal> selector{};  ///< the multiplexor; none: the message has one part
  std::uint64_t selected_by = 0;          ///< its value for this part
  std::optional<dbc::Signal> sequence{};
  std::vector<LegField> fields{};
};

/// The message that begins a round of samples.
struct SyncMessage {
  std::uint32_t id = 0;
  bool extended = false;
  std::size_t length = 0;
  dbc::Signal sequence;
  std::optional<dbc::Signal> time{};
  Duration period{};  ///< after which `time` begins again from 0, 10 ms to 1e9 s; zero without it
};

/// What a frame is to the dictionary.
enum class FrameKind : std::uint8_t {
  kForeign,  ///< its identifier is not in the dictionary
  kOther,    ///< in the dictionary, but nothing of the legs (or of a part without a meaning)
  kSync,
  kLeg,
  kTooShort,  ///< shorter than the dictionary says
};

/// Immutable once made; thread-safe.
class LegDictionary {
 public:
  /// Errors name the database's file, and the line where there is one: a joint without angle or
  /// rate, a unit that is none of those above, a multiplexed signal without a multiplexor, a
  /// message with values of two legs that are not multiplexed.
  [[nodiscard]] static Result<LegDictionary> from(const dbc::Database& database);
  /// Reads `file`; an empty path is the dictionary that comes with the program,
  /// config/go2_legs.dbc.
  [[nodiscard]] static Result<LegDictionary> load(const std::filesystem::path& file);

  struct Match {
    FrameKind kind = FrameKind::kForeign;
    std::size_t group = 0;  ///< index into groups() of a kLeg
  };
  /// Remote requests and error reports are foreign.
  [[nodiscard]] Match match(const Frame& frame) const noexcept;

  [[nodiscard]] const std::vector<FieldGroup>& groups() const noexcept { return groups_; }
  [[nodiscard]] const std::optional<SyncMessage>& sync() const noexcept { return sync_; }

  /// One identifier that the dictionary knows.
  struct Identifier {
    std::uint32_t id = 0;
    bool extended = false;
    std::size_t length = 0;
    friend auto operator<=>(const Identifier& a, const Identifier& b) noexcept {
      return a.key() <=> b.key();
    }
    friend bool operator==(const Identifier& a, const Identifier& b) noexcept {
      return a.key() == b.key();
    }
    [[nodiscard]] std::uint64_t key() const noexcept {
      return (extended ? std::uint64_t{1} << 32U : 0U) | id;
    }
  };
  /// All of them, in ascending order: what to let through.
  [[nodiscard]] const std::vector<Identifier>& identifiers() const noexcept { return identifiers_; }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }

 private:
  [[nodiscard]] Result<void> add(const dbc::Message& message);
  [[nodiscard]] Result<void> add_sync(const dbc::Message& message);
  [[nodiscard]] bool has(Quantity quantity, std::size_t joint) const;
  [[nodiscard]] Result<void> check_complete() const;
  void index();

  std::string name_;
  std::vector<FieldGroup> groups_;
  std::optional<SyncMessage> sync_;
  std::vector<Identifier> identifiers_;              // sorted
  std::vector<std::vector<std::size_t>> groups_of_;  // by index into identifiers_
};

/// `FR`, `FL`, `RR`, `RL`.
[[nodiscard]] std::string_view leg_name(Leg leg) noexcept;

/// The text of config/go2_legs.dbc as it was when the program was built.
[[nodiscard]] std::string_view shipped_dictionary() noexcept;

}  // namespace geoflow::drivers::can
