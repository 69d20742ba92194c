#include "can/link_monitor.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <fmt/format.h>
#include <linux/can/error.h>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/snapshot.hpp"

namespace geoflow::drivers::can {
namespace {

constexpr std::size_t kControllerState = 1;  // the byte of an error report (linux/can/error.h)

std::string hex(std::uint32_t id) {
  return fmt::format("0x{:X}", id);
}

/// The identifiers of a leg's frames.
std::string identifiers_of(const LegDictionary& dictionary, Leg leg) {
  std::set<std::uint32_t> ids;
  for (const FieldGroup& group : dictionary.groups()) {
    if (group.leg == leg) {
      ids.insert(group.id);
    }
  }
  std::string text;
  for (const std::uint32_t id : ids) {
    text.append(text.empty() ? "" : ", ").append(hex(id));
  }
  return text;
}

bool is_recent(const std::optional<HostTime>& t, HostTime now, Duration memory) {
  return t && now - *t <= memory;
}

}  // namespace

LinkMonitor::LinkMonitor(const LegDictionary& dictionary, std::vector<std::string> interfaces)
    : dictionary_{dictionary}, interfaces_{std::move(interfaces)} {}

void LinkMonitor::opened(HostTime now) {
  failure_.reset();
  bus_off_.reset();
  listening_since_ = now;
}

void LinkMonitor::failed(const Error& error) {
  failure_ = error.message;
}

std::string LinkMonitor::bus_name(std::uint8_t bus) const {
  return bus < interfaces_.size() ? interfaces_[bus] : "CAN";
}

void LinkMonitor::on_frame(const Received& received, FrameKind kind) {
  if (received.frame.error) {
    on_error_report(received);
    return;
  }
  bus_off_.reset();
  if (kind == FrameKind::kTooShort) {
    last_too_short_ = received.t_arrival;
  } else if (kind != FrameKind::kForeign) {
    last_known_ = received.t_arrival;
    foreign_.clear();
  } else {
    last_foreign_ = received.t_arrival;
    const std::string id = hex(received.frame.id);
    if (foreign_.size() < kForeignNamed && std::ranges::find(foreign_, id) == foreign_.end()) {
      foreign_.push_back(id);
    }
  }
}

void LinkMonitor::on_error_report(const Received& received) {
  const std::string bus = bus_name(received.bus);
  const std::uint32_t kind = received.frame.id;
  if ((kind & CAN_ERR_BUSOFF) != 0) {
    bus_off_ = fmt::format(
        "{} is bus-off: too many errors. Check cable, termination and bit rate; `ip link set {} "
        "type can restart-ms 100` lets it try again by itself",
        bus, bus);
  }
  if ((kind & CAN_ERR_RESTARTED) != 0) {
    bus_off_.reset();
  }
  const auto state = std::to_integer<unsigned>(received.frame.data[kControllerState]);
  if ((kind & CAN_ERR_CRTL) == 0) {
    return;
  }
  if ((state & CAN_ERR_CRTL_RX_OVERFLOW) != 0) {
    overflow_ = Event{.t = received.t_arrival,
                      .what = fmt::format("{}: the controller's receive buffer overflowed", bus)};
  }
  if ((state & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
    error_passive_ =
        Event{.t = received.t_arrival,
              .what = fmt::format("{} is error-passive: many frames are damaged. Check cable, "
                                  "termination and bit rate",
                                  bus)};
  }
}

void LinkMonitor::on_overflow(std::uint64_t dropped, HostTime now) {
  if (dropped != dropped_) {
    overflow_ = Event{.t = now,
                      .what = fmt::format("the kernel dropped {} frames because they were not read "
                                          "in time: this machine is overloaded",
                                          dropped)};
    dropped_ = dropped;
  }
}

bool LinkMonitor::is_silent(HostTime now) const {
  const HostTime since = std::max(last_known_.value_or(listening_since_), listening_since_);
  return now - since > kSilence;
}

LinkReport LinkMonitor::silence(HostTime now) const {
  const std::string buses = fmt::format("{}", fmt::join(interfaces_, ", "));
  if (is_recent(last_too_short_, now, kMemory)) {
    return {.trouble = LinkTrouble::kForeignOnly,
            .state = SourceState::kFailed,
            .reason = fmt::format("{}: frames are shorter than the dictionary {} says: is it the "
                                  "right one?",
                                  buses, dictionary_.name())};
  }
  if (is_recent(last_foreign_, now, kMemory) && !foreign_.empty()) {
    return {.trouble = LinkTrouble::kForeignOnly,
            .state = SourceState::kFailed,
            .reason = fmt::format("{}: frames come ({}), but none that the dictionary {} knows: "
                                  "wrong interface, or wrong dictionary?",
                                  buses, fmt::join(foreign_, ", "), dictionary_.name())};
  }
  return {.trouble = LinkTrouble::kSilent,
          .state = SourceState::kFailed,
          .reason = fmt::format("{}: nothing comes. Are the legs' boards on, and is the bit rate "
                                "right?",
                                buses)};
}

std::optional<LinkReport> LinkMonitor::missing_legs(HostTime now,
                                                    const SnapshotAssembler& assembler) const {
  std::string silent;
  for (std::size_t i = 0; i < kLegCount; ++i) {
    const Leg leg = static_cast<Leg>(i);
    const HostTime heard = assembler.last_heard(leg).value_or(listening_since_);
    if (now - std::max(heard, listening_since_) <= kSilence) {
      continue;
    }
    if (is_recent(assembler.last_out_of_step(leg), now, kSilence)) {
      return LinkReport{.trouble = LinkTrouble::kOutOfStep,
                        .state = SourceState::kDegraded,
                        .reason = fmt::format("leg {}: its counter is not SYNC's, so its frames "
                                              "({}) are not used",
                                              leg_name(leg), identifiers_of(dictionary_, leg))};
    }
    silent += fmt::format("{}leg {} ({})", silent.empty() ? "" : "; ", leg_name(leg),
                          identifiers_of(dictionary_, leg));
  }
  if (silent.empty()) {
    return std::nullopt;
  }
  return LinkReport{.trouble = LinkTrouble::kMissingLeg,
                    .state = SourceState::kDegraded,
                    .reason = fmt::format("missing: {}", silent)};
}

LinkReport LinkMonitor::assess(HostTime now, const SnapshotAssembler& assembler) const {
  if (failure_) {
    return {
        .trouble = LinkTrouble::kNoInterface, .state = SourceState::kFailed, .reason = *failure_};
  }
  if (bus_off_) {
    return {.trouble = LinkTrouble::kBusOff, .state = SourceState::kFailed, .reason = *bus_off_};
  }
  if (is_silent(now)) {
    return silence(now);
  }
  if (overflow_ && now - overflow_->t <= kMemory) {
    return {.trouble = LinkTrouble::kOverflow,
            .state = SourceState::kDegraded,
            .reason = overflow_->what};
  }
  if (auto missing = missing_legs(now, assembler)) {
    return *std::move(missing);
  }
  if (error_passive_ && now - error_passive_->t <= kMemory) {
    return {.trouble = LinkTrouble::kErrorPassive,
            .state = SourceState::kDegraded,
            .reason = error_passive_->what};
  }
  return {};
}

}  // namespace geoflow::drivers::can
