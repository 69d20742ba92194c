#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

#include "replay/bag/samples.hpp"
#include "replay/cdr/messages.hpp"

namespace geoflow::drivers::bag {
namespace {

constexpr std::size_t kJointCount = kLegCount * kJointsPerLeg;
constexpr std::array<std::string_view, kLegCount> kLegNames{"FR", "FL", "RR", "RL"};
constexpr std::array<std::string_view, kJointsPerLeg> kJointNames{"hip", "thigh", "calf"};
constexpr std::string_view kFootName = "foot";

/// What an entry of a JointState is: slots 0 to 11 are joints in the order of LegSample, 12 to 15
/// feet.
using Slot = std::size_t;
constexpr std::size_t kSlotCount = kJointCount + kLegCount;

/// The part of a leg that the rest of a name tells: 0 to 2 a joint, 3 the foot.
std::optional<std::size_t> part_of(std::string_view rest) {
  while (!rest.empty() && rest.front() == '_') {
    rest.remove_prefix(1);
  }
  if (rest.starts_with(kFootName)) {
    return kJointsPerLeg;
  }
  for (std::size_t joint = 0; joint < kJointsPerLeg; ++joint) {
    const bool by_number = rest.size() == 1 && rest.front() == static_cast<char>('0' + joint);
    if (by_number || rest.starts_with(kJointNames[joint])) {
      return joint;
    }
  }
  return std::nullopt;
}

std::optional<Slot> slot_of(std::string_view name) {
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    if (name.starts_with(kLegNames[leg])) {
      const auto part = part_of(name.substr(kLegNames[leg].size()));
      if (!part) {
        return std::nullopt;
      }
      return *part == kJointsPerLeg ? kJointCount + leg : leg * kJointsPerLeg + *part;
    }
  }
  return std::nullopt;
}

/// The slots of the message's entries: by their names, or in SDK order where none of them tells a
/// leg.
Result<std::vector<Slot>> slots_of(const ros::JointState& message) {
  std::vector<Slot> slots;
  const std::string* unknown = nullptr;
  for (const std::string& name : message.name) {
    if (const auto slot = slot_of(name)) {
      slots.push_back(*slot);
    } else {
      unknown = &name;
    }
  }
  if (!slots.empty()) {
    if (unknown != nullptr) {
      return fail(ErrorCode::kInvalidData, "joint '{}' is of no leg that is known by name",
                  *unknown);
    }
    return slots;
  }
  const std::size_t count = message.position.size();
  if (count != kJointCount && count != kSlotCount) {
    return fail(ErrorCode::kInvalidData,
                "{} joints without known names, where 12 or 16 are expected", count);
  }
  for (Slot slot = 0; slot < count; ++slot) {
    slots.push_back(slot);
  }
  return slots;
}

/// The i-th element; 0 where the message leaves the whole sequence out.
double at_or_zero(std::span<const double> values, std::size_t i) {
  return i < values.size() ? values[i] : 0.0;
}

}  // namespace

Result<LegSample> to_sample(const ros::JointState& message) {
  const auto slots = slots_of(message);
  if (!slots) {
    return tl::unexpected{slots.error()};
  }
  const auto fits = [&slots](const std::vector<double>& values) {
    return values.empty() || values.size() == slots->size();
  };
  if (message.position.size() != slots->size() || !fits(message.velocity) ||
      !fits(message.effort)) {
    return fail(ErrorCode::kInvalidData,
                "{} joints with {} positions, {} velocities and {} efforts", slots->size(),
                message.position.size(), message.velocity.size(), message.effort.size());
  }
  LegSample sample;
  std::array<bool, kSlotCount> seen{};
  for (std::size_t i = 0; i < slots->size(); ++i) {
    const Slot slot = (*slots)[i];
    if (seen[slot]) {
      return fail(ErrorCode::kInvalidData, "joint '{}' is there twice", message.name[i]);
    }
    seen[slot] = true;
    const double effort = at_or_zero(message.effort, i);
    if (slot < kJointCount) {
      sample.joints[slot] = {.q_rad = message.position[i],
                             .dq_radps = at_or_zero(message.velocity, i),
                             .tau_nm = effort};
    } else {
      sample.foot_force[slot - kJointCount] = static_cast<float>(effort);
    }
  }
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    const std::size_t hip = leg * kJointsPerLeg;
    sample.valid[leg] = seen[hip] && seen[hip + 1] && seen[hip + 2];
  }
  return sample;
}

ros::JointState to_message(const LegSample& sample) {
  ros::JointState message;
  const auto add = [&message](std::string name, const JointState& joint) {
    message.name.push_back(std::move(name));
    message.position.push_back(joint.q_rad);
    message.velocity.push_back(joint.dq_radps);
    message.effort.push_back(joint.tau_nm);
  };
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    for (std::size_t joint = 0; sample.valid[leg] && joint < kJointsPerLeg; ++joint) {
      add(fmt::format("{}_{}_joint", kLegNames[leg], kJointNames[joint]),
          sample.joints[leg * kJointsPerLeg + joint]);
    }
  }
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    add(fmt::format("{}_{}", kLegNames[leg], kFootName),
        {.tau_nm = static_cast<double>(sample.foot_force[leg])});
  }
  return message;
}

}  // namespace geoflow::drivers::bag
