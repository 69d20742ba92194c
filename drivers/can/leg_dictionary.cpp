#include "can/leg_dictionary.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/dbc/database.hpp"
#include "can/dbc/signal.hpp"
#include "can/frame.hpp"

namespace geoflow::drivers::can {
namespace {

constexpr std::array<std::string_view, kLegCount> kLegNames{"FR", "FL", "RR", "RL"};
constexpr std::array<std::string_view, kJointsPerLeg> kJointNames{"hip", "thigh", "calf"};
constexpr std::string_view kSyncName = "SYNC";
constexpr std::string_view kShippedName = "config/go2_legs.dbc";
constexpr std::size_t kJointCount = kLegCount * kJointsPerLeg;
constexpr std::uint8_t kMostCounterBits = 32;
// After how long the time of SYNC may begin again [s]: several rounds, and what a Duration can
// hold.
constexpr double kShortestTimePeriodS = 0.01;
constexpr double kLongestTimePeriodS = 1e9;

/// A kind of joint value: how names end, and in which unit.
struct JointQuantity {
  std::string_view suffix;
  std::string_view unit;
  Quantity quantity;
};
constexpr std::array kJointQuantities = {
    JointQuantity{.suffix = "q", .unit = "rad", .quantity = Quantity::kAngle},
    JointQuantity{.suffix = "dq", .unit = "rad/s", .quantity = Quantity::kRate},
    JointQuantity{.suffix = "tau", .unit = "Nm", .quantity = Quantity::kTorque}};

/// What a signal's name makes of it.
struct Role {
  std::size_t leg = 0;
  bool sequence = false;
  Quantity quantity = Quantity::kAngle;
  std::size_t index = 0;
  std::string_view unit{};  // that it must have; empty: any
};

std::optional<Role> joint_role(std::size_t leg, std::string_view rest) {
  for (std::size_t joint = 0; joint < kJointsPerLeg; ++joint) {
    for (const JointQuantity& kind : kJointQuantities) {
      if (rest == fmt::format("{}_{}", kJointNames[joint], kind.suffix)) {
        return Role{.leg = leg,
                    .quantity = kind.quantity,
                    .index = leg * kJointsPerLeg + joint,
                    .unit = kind.unit};
      }
    }
  }
  return std::nullopt;
}

std::optional<Role> role_of(std::string_view name) {
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    if (!name.starts_with(kLegNames[leg]) || !name.substr(kLegNames[leg].size()).starts_with('_')) {
      continue;
    }
    const std::string_view rest = name.substr(kLegNames[leg].size() + 1);
    if (rest == "seq") {
      return Role{.leg = leg, .sequence = true};
    }
    if (rest == "foot_force") {
      return Role{.leg = leg, .quantity = Quantity::kFootForce, .index = leg};
    }
    return joint_role(leg, rest);
  }
  return std::nullopt;
}

/// The parts of a message by the multiplexor's value; one without a value where it has none.
using Parts = std::map<std::optional<std::uint64_t>, FieldGroup>;

const dbc::Signal* multiplexor_of(const dbc::Message& message) {
  const auto found = std::ranges::find_if(message.signals, &dbc::Signal::multiplexor);
  return found == message.signals.end() ? nullptr : &*found;
}

FieldGroup new_part(const dbc::Message& message, std::optional<std::uint64_t> selected_by) {
  FieldGroup part{.name = message.name,
                  .id = message.id,
                  .extended = message.extended,
                  .fd = message.fd,
                  .length = message.length};
  if (const dbc::Signal* selector = multiplexor_of(message); selector != nullptr && selected_by) {
    part.selector = *selector;
    part.selected_by = *selected_by;
  }
  return part;
}

/// A counter of a whole number of steps, without offset.
bool is_counter(const dbc::Signal& signal) noexcept {
  return signal.type == dbc::ValueType::kUnsigned && signal.factor == 1 && signal.offset == 0 &&
         signal.field.bits <= kMostCounterBits;
}

Result<void> put(FieldGroup& part, const dbc::Signal& signal, const Role& role) {
  const bool empty = part.fields.empty() && !part.sequence;
  if (!empty && part.leg != static_cast<Leg>(role.leg)) {
    return fail(ErrorCode::kInvalidData, "values of two legs ({} and {}) in one message",
                leg_name(part.leg), kLegNames[role.leg]);
  }
  part.leg = static_cast<Leg>(role.leg);
  if (role.sequence) {
    if (!is_counter(signal)) {
      return fail(ErrorCode::kInvalidData,
                  "must be an unsigned counter of at most 32 bits with factor 1 and offset 0");
    }
    part.sequence = signal;
    return {};
  }
  if (!role.unit.empty() && signal.unit != role.unit) {
    return fail(ErrorCode::kInvalidData, "has the unit '{}'; it must be in {}", signal.unit,
                role.unit);
  }
  part.fields.push_back({.quantity = role.quantity, .index = role.index, .signal = signal});
  return {};
}

}  // namespace

std::string_view leg_name(Leg leg) noexcept {
  return kLegNames[static_cast<std::size_t>(leg)];
}

Result<void> LegDictionary::add(const dbc::Message& message) {
  Parts parts;
  for (const dbc::Signal& signal : message.signals) {
    const auto role = role_of(signal.name);
    if (!role) {
      continue;
    }
    const std::string where = fmt::format("{}:{}: signal {} of message {}", name_, signal.line,
                                          signal.name, message.name);
    if (signal.multiplexed_by.has_value() != (multiplexor_of(message) != nullptr)) {
      return fail(
          ErrorCode::kInvalidData,
          "{}: where there is a multiplexor (M), each value of a leg must be multiplexed by "
          "it, and only there",
          where);
    }
    const auto [part, is_new] = parts.try_emplace(signal.multiplexed_by);
    if (is_new) {
      part->second = new_part(message, signal.multiplexed_by);
    }
    if (auto done = put(part->second, signal, *role); !done) {
      return tl::unexpected{std::move(done.error()).in(where)};
    }
  }
  for (auto& [value, part] : parts) {
    groups_.push_back(std::move(part));
  }
  return {};
}

Result<void> LegDictionary::add_sync(const dbc::Message& message) {
  const dbc::Signal* const sequence = message.find("seq");
  const auto time = std::ranges::find_if(
      message.signals, [](const dbc::Signal& signal) { return signal.name.starts_with("time"); });
  if (sequence == nullptr || !is_counter(*sequence)) {
    return fail(ErrorCode::kInvalidData,
                "{}:{}: message SYNC has no signal seq that is an unsigned counter of at most 32 "
                "bits with factor 1 and offset 0",
                name_, message.line);
  }
  SyncMessage sync{.id = message.id,
                   .extended = message.extended,
                   .length = message.length,
                   .sequence = *sequence};
  if (time != message.signals.end()) {
    const bool counts = time->type == dbc::ValueType::kUnsigned && time->offset == 0 &&
                        time->factor > 0 && time->field.bits <= kMostCounterBits;
    if (!counts || time->unit != "s") {
      return fail(ErrorCode::kInvalidData,
                  "{}:{}: signal {} of message SYNC must be an unsigned time in s of at most 32 "
                  "bits without offset",
                  name_, time->line, time->name);
    }
    const double period_s = std::ldexp(time->factor, time->field.bits);
    if (period_s < kShortestTimePeriodS || period_s > kLongestTimePeriodS) {
      return fail(ErrorCode::kInvalidData,
                  "{}:{}: signal {} of message SYNC begins again every {} s; it must be {} to {} s",
                  name_, time->line, time->name, period_s, kShortestTimePeriodS,
                  kLongestTimePeriodS);
    }
    sync.time = *time;
    sync.period = from_seconds(period_s);
  }
  sync_ = std::move(sync);
  return {};
}

bool LegDictionary::has(Quantity quantity, std::size_t joint) const {
  return std::ranges::any_of(groups_, [&](const FieldGroup& group) {
    return std::ranges::any_of(group.fields, [&](const LegField& field) {
      return field.quantity == quantity && field.index == joint;
    });
  });
}

Result<void> LegDictionary::check_complete() const {
  for (const JointQuantity& kind : kJointQuantities) {
    for (std::size_t joint = 0; joint < kJointCount; ++joint) {
      if (kind.quantity != Quantity::kTorque && !has(kind.quantity, joint)) {
        return fail(ErrorCode::kInvalidData, "{}: no message has a signal {}_{}_{}", name_,
                    kLegNames[joint / kJointsPerLeg], kJointNames[joint % kJointsPerLeg],
                    kind.suffix);
      }
    }
  }
  return {};
}

void LegDictionary::index() {
  std::ranges::sort(identifiers_);
  groups_of_.assign(identifiers_.size(), {});
  for (std::size_t i = 0; i < groups_.size(); ++i) {
    const Identifier wanted{.id = groups_[i].id, .extended = groups_[i].extended};
    const auto found = std::ranges::lower_bound(identifiers_, wanted);
    groups_of_[static_cast<std::size_t>(found - identifiers_.begin())].push_back(i);
  }
}

Result<LegDictionary> LegDictionary::from(const dbc::Database& database) {
  LegDictionary dictionary;
  dictionary.name_ = database.name;
  for (const dbc::Message& message : database.messages) {
    dictionary.identifiers_.push_back(
        {.id = message.id, .extended = message.extended, .length = message.length});
    auto added = message.name == kSyncName ? dictionary.add_sync(message) : dictionary.add(message);
    if (!added) {
      return tl::unexpected{std::move(added.error())};
    }
  }
  if (auto complete = dictionary.check_complete(); !complete) {
    return tl::unexpected{std::move(complete.error())};
  }
  dictionary.index();
  return dictionary;
}

Result<LegDictionary> LegDictionary::load(const std::filesystem::path& file) {
  const auto database =
      file.empty() ? dbc::parse(shipped_dictionary(), kShippedName) : dbc::load(file);
  return database ? from(*database) : tl::unexpected{database.error()};
}

LegDictionary::Match LegDictionary::match(const Frame& frame) const noexcept {
  const Identifier wanted{.id = frame.id, .extended = frame.extended};
  const auto found = std::ranges::lower_bound(identifiers_, wanted);
  if (frame.error || frame.remote || found == identifiers_.end() || *found != wanted) {
    return {};
  }
  if (frame.length < found->length) {
    return {.kind = FrameKind::kTooShort};
  }
  if (sync_ && sync_->id == frame.id && sync_->extended == frame.extended) {
    return {.kind = FrameKind::kSync};
  }
  for (const std::size_t i : groups_of_[static_cast<std::size_t>(found - identifiers_.begin())]) {
    const FieldGroup& group = groups_[i];
    if (!group.selector || group.selector->raw(frame.payload()) == group.selected_by) {
      return {.kind = FrameKind::kLeg, .group = i};
    }
  }
  return {.kind = FrameKind::kOther};
}

}  // namespace geoflow::drivers::can
