#include "geoflow/timesync/packet_queue.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/synced_packet.hpp"

namespace geoflow::timesync {
namespace {

/// Puts the earlier window's samples before the later one's. Windows overlap by the samples around
/// the time where they meet.
template <typename Sample>
void prepend(std::vector<Timed<Sample>>& earlier, std::vector<Timed<Sample>>& later,
             std::size_t capacity) {
  if (!later.empty()) {
    const auto overlap = std::ranges::lower_bound(earlier, later.front().t, {}, &Timed<Sample>::t);
    earlier.erase(overlap, earlier.end());
  }
  earlier.insert(earlier.end(), later.begin(), later.end());
  if (earlier.size() > capacity) {
    earlier.erase(earlier.begin(), std::prev(earlier.end(), static_cast<std::ptrdiff_t>(capacity)));
  }
  later = std::move(earlier);
}

}  // namespace

PacketQueue::PacketQueue(std::size_t packets, std::size_t samples)
    : capacity_{std::max<std::size_t>(packets, 1)}, samples_{samples} {
  packets_.reserve(capacity_);
}

void PacketQueue::push(SyncedPacket packet) {
  const std::scoped_lock lock{mutex_};
  if (packets_.size() == capacity_) {
    SyncedPacket oldest = std::move(packets_.front());
    packets_.erase(packets_.begin());
    SyncedPacket& next = packets_.empty() ? packet : packets_.front();
    prepend(oldest.imu, next.imu, samples_);
    prepend(oldest.legs, next.legs, samples_);
    prepend(oldest.body_velocity, next.body_velocity, samples_);
    ++dropped_;
  }
  packets_.push_back(std::move(packet));
}

std::optional<SyncedPacket> PacketQueue::try_pop() {
  const std::scoped_lock lock{mutex_};
  if (packets_.empty()) {
    return std::nullopt;
  }
  std::optional<SyncedPacket> oldest{std::move(packets_.front())};
  packets_.erase(packets_.begin());
  return oldest;
}

std::uint64_t PacketQueue::dropped() const {
  const std::scoped_lock lock{mutex_};
  return dropped_;
}

}  // namespace geoflow::timesync
