#include "can/leg_encoder.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "can/dbc/signal.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"

namespace geoflow::drivers::can {
namespace {

double value_of(const LegSample& sample, const LegField& field) {
  switch (field.quantity) {
    case Quantity::kAngle:
      return sample.joints[field.index].q_rad;
    case Quantity::kRate:
      return sample.joints[field.index].dq_radps;
    case Quantity::kTorque:
      return sample.joints[field.index].tau_nm;
    case Quantity::kFootForce:
      return static_cast<double>(sample.foot_force[field.index]);
  }
  return 0;
}

Frame frame_of(const FieldGroup& group, const LegSample& sample, std::uint64_t round) {
  Frame frame{.id = group.id,
              .extended = group.extended,
              .fd = group.fd,
              .length = static_cast<std::uint8_t>(group.length)};
  const std::span<std::byte> payload = std::span{frame.data}.first(group.length);
  if (group.selector) {
    dbc::write_bits(group.selector->field, group.selected_by, payload);
  }
  if (group.sequence) {
    dbc::write_bits(group.sequence->field, round, payload);
  }
  for (const LegField& field : group.fields) {
    field.signal.encode(value_of(sample, field), payload);
  }
  return frame;
}

Frame sync_frame(const SyncMessage& sync, std::uint64_t round, Duration device_time) {
  Frame frame{
      .id = sync.id, .extended = sync.extended, .length = static_cast<std::uint8_t>(sync.length)};
  const std::span<std::byte> payload = std::span{frame.data}.first(sync.length);
  dbc::write_bits(sync.sequence.field, round, payload);
  if (sync.time) {
    sync.time->encode(to_seconds(device_time % sync.period), payload);
  }
  return frame;
}

}  // namespace

std::vector<Frame> LegEncoder::encode(const LegSample& sample, std::uint64_t round,
                                      Duration device_time) const {
  std::vector<Frame> frames;
  for (const FieldGroup& group : dictionary_.groups()) {
    if (group.fd == fd_ && sample.valid[static_cast<std::size_t>(group.leg)]) {
      frames.push_back(frame_of(group, sample, round));
    }
  }
  std::ranges::stable_sort(frames, {}, &Frame::id);
  if (const auto& sync = dictionary_.sync()) {
    frames.insert(frames.begin(), sync_frame(*sync, round, device_time));
  }
  return frames;
}

}  // namespace geoflow::drivers::can
