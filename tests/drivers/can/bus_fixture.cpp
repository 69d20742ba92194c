#include "can/bus_fixture.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/candump.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/leg_encoder.hpp"

namespace geoflow::drivers::can::tests {

const LegDictionary& dictionary() {
  static const LegDictionary loaded = LegDictionary::load({}).value();
  return loaded;
}

Frame frame(std::string_view text) {
  const std::string line = fmt::format("(1.000000) can0 {}", text);
  const auto parsed = parse_log_line(line);
  EXPECT_TRUE(parsed) << text;
  return parsed ? parsed->frame : Frame{};
}

LegSample sample_of(std::uint64_t number) {
  LegSample sample;
  const double step = static_cast<double>(number % 1000);
  for (std::size_t i = 0; i < sample.joints.size(); ++i) {
    const auto joint = static_cast<double>(i);
    sample.joints[i] = {.q_rad = 0.1 * joint + 0.001 * step,
                        .dq_radps = joint - 0.01 * step,
                        .tau_nm = 2 * joint + 0.01 * step};
  }
  for (std::size_t i = 0; i < kLegCount; ++i) {
    sample.foot_force[i] = static_cast<float>(10 * i) + static_cast<float>(number % 1000);
    sample.valid[i] = true;
  }
  return sample;
}

double value_of(const LegSample& sample, const LegField& field) {
  switch (field.quantity) {
    case Quantity::kAngle:
      return sample.joints.at(field.index).q_rad;
    case Quantity::kRate:
      return sample.joints.at(field.index).dq_radps;
    case Quantity::kTorque:
      return sample.joints.at(field.index).tau_nm;
    case Quantity::kFootForce:
      return static_cast<double>(sample.foot_force.at(field.index));
  }
  return 0;
}

bool is_same(const LegSample& a, const LegSample& b) {
  constexpr double kHalfAngleStep = 0.0001 + 1e-9;
  constexpr double kHalfStep = 0.001 + 1e-9;
  bool same = a.valid == b.valid && a.foot_force == b.foot_force;
  for (std::size_t i = 0; i < a.joints.size(); ++i) {
    same = same && std::abs(a.joints[i].q_rad - b.joints[i].q_rad) <= kHalfAngleStep &&
           std::abs(a.joints[i].dq_radps - b.joints[i].dq_radps) <= kHalfStep &&
           std::abs(a.joints[i].tau_nm - b.joints[i].tau_nm) <= kHalfStep;
  }
  return same;
}

std::vector<Received> rounds(std::uint64_t first, std::uint64_t count, HostTime begin, bool fd) {
  std::vector<Received> received;
  const LegEncoder encoder{dictionary(), fd};
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t number = first + i;
    HostTime t = begin + static_cast<std::int64_t>(i) * kRoundPeriod;
    const Duration device = static_cast<std::int64_t>(number) * kRoundPeriod;
    for (const Frame& sent : encoder.encode(sample_of(number), number, device)) {
      received.push_back({.frame = sent, .t_arrival = t});
      t += kFrameTime;
    }
  }
  return received;
}

}  // namespace geoflow::drivers::can::tests
