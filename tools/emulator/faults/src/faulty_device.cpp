#include "geoflow/tools/emulator/faulty_device.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/fault.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {
namespace {

constexpr std::uint8_t kImuEndpoint = 0x86;
constexpr std::size_t kStandardHeader = 12;

std::size_t header_size(const Bytes& payload) {
  return payload.empty() ? 0
                         : std::min(std::to_integer<std::size_t>(payload.front()), payload.size());
}

void invert_middle(Bytes& payload) {
  const std::size_t header = header_size(payload);
  const std::size_t third = (payload.size() - header) / 3;
  for (std::size_t i = header + third; i < header + 2 * third; ++i) {
    payload[i] = ~payload[i];
  }
}

void drop_metadata(Bytes& payload) {
  const std::size_t header = header_size(payload);
  if (header > kStandardHeader) {
    payload.erase(payload.begin() + kStandardHeader,
                  payload.begin() + static_cast<std::ptrdiff_t>(header));
    payload.front() = std::byte{kStandardHeader};
  }
}

void change_layout(Bytes& report) {
  constexpr std::size_t kNarrow = 32;
  constexpr std::size_t kWide = 38;
  report.resize(report.size() == kNarrow ? kWide : kNarrow);
}

}  // namespace

FaultyDevice::FaultyDevice(UsbDevice& device, std::vector<TimedFault> faults)
    : device_{device}, faults_{std::move(faults)} {}

bool FaultyDevice::active(DeviceFault fault, std::uint8_t endpoint, HostTime now) const {
  return epoch_ && std::any_of(faults_.begin(), faults_.end(), [&](const TimedFault& timed) {
           const Duration t = now - *epoch_ - timed.start;
           return timed.fault == fault && timed.endpoint.value_or(endpoint) == endpoint &&
                  t >= Duration::zero() && t < timed.duration;
         });
}

std::optional<std::size_t> FaultyDevice::new_stall(std::uint8_t endpoint, HostTime now) const {
  for (std::size_t i = 0; i < faults_.size(); ++i) {
    const TimedFault& timed = faults_[i];
    if (epoch_ && timed.fault == DeviceFault::kStall &&
        timed.endpoint.value_or(endpoint) == endpoint && now - *epoch_ >= timed.start &&
        !stalled_.contains(i)) {
      return i;
    }
  }
  return std::nullopt;
}

std::optional<Bytes> FaultyDevice::control(const SetupPacket& setup, std::span<const std::byte> out,
                                           HostTime now) {
  constexpr std::uint8_t kToEndpoint = 0x02;
  constexpr std::uint8_t kClearFeature = 1;
  if (!connected(now)) {
    return std::nullopt;
  }
  if (setup.request_type == kToEndpoint && setup.request == kClearFeature && setup.value == 0) {
    halted_.erase(static_cast<std::uint8_t>(setup.index));
  }
  return device_.control(setup, out, now);
}

void FaultyDevice::spoil(std::uint8_t endpoint, Bytes& data, HostTime now) {
  const auto is = [&](DeviceFault fault) { return active(fault, endpoint, now); };
  if (endpoint == kImuEndpoint) {
    if (is(DeviceFault::kOtherLayout)) {
      change_layout(data);
    }
  } else {
    const std::size_t header = header_size(data);
    const auto image = data.begin() + static_cast<std::ptrdiff_t>(header);
    if (!is(DeviceFault::kFrozen)) {
      frozen_.erase(endpoint);
    } else {
      const auto [kept, first] = frozen_.try_emplace(endpoint, image, data.end());
      if (!first && kept->second.size() == data.size() - header) {
        std::copy(kept->second.begin(), kept->second.end(), image);
      }
    }
    if (is(DeviceFault::kCorrupt)) {
      invert_middle(data);
    }
    if (is(DeviceFault::kNoMetadata)) {
      drop_metadata(data);
    }
    if (is(DeviceFault::kErrorBit) && data.size() > 1) {
      constexpr std::byte kError{0x40};
      data[1] |= kError;
    }
    if (is(DeviceFault::kBadHeader) && !data.empty()) {
      data.front() = std::byte{1};
    }
  }
  if (is(DeviceFault::kShort)) {
    data.resize(data.size() / 2);
  }
}

InTransfer FaultyDevice::next_in(std::uint8_t endpoint, HostTime now) {
  if (!connected(now)) {
    return {};
  }
  if (const auto stall = new_stall(endpoint, now)) {
    stalled_.insert(*stall);
    halted_.insert(endpoint);
  }
  if (halted_.contains(endpoint)) {
    return {.status = InStatus::kStall, .data = {}};
  }
  InTransfer transfer = device_.next_in(endpoint, now);
  if (transfer.status != InStatus::kData) {
    return transfer;
  }
  epoch_ = epoch_.value_or(now);
  if (active(DeviceFault::kSilent, endpoint, now)) {
    return {};
  }
  if (active(DeviceFault::kBroken, endpoint, now)) {
    return {.status = InStatus::kBroken, .data = {}};
  }
  spoil(endpoint, transfer.data, now);
  return transfer;
}

HostTime FaultyDevice::next_due(std::uint8_t endpoint, HostTime now) {
  HostTime due = device_.next_due(endpoint, now);
  for (const TimedFault& timed : faults_) {
    if (!epoch_ || timed.fault != DeviceFault::kUnplug) {
      continue;
    }
    const HostTime start = *epoch_ + timed.start;
    if (now < start) {
      due = std::min(due, start);
    } else if (now < start + timed.duration) {
      return start + timed.duration;
    }
  }
  return halted_.contains(endpoint) ? now : due;
}

bool FaultyDevice::connected(HostTime now) {
  return device_.connected(now) && !active(DeviceFault::kUnplug, 0, now);
}

void FaultyDevice::reset(HostTime now) {
  halted_.clear();
  device_.reset(now);
}

}  // namespace geoflow::emulator
