#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "geoflow/hal/synced_packet.hpp"

namespace geoflow::timesync {

/// Packets on their way to an estimator that may be slower than the camera. When full it gives up
/// the oldest one's images, and those only: its IMU, leg and body-velocity samples go over to the
/// packet after it, so that what the estimator takes are samples without a gap since the packet
/// that it took before, as SyncedPacket promises. Without them it could not tell how the robot has
/// moved across the images that it did not see.
///
/// Thread-safe. Both sides hold a lock for as long as it takes to move a packet's pointers, and
/// push at most for a copy of the samples that one packet holds. Waiting is kept out of the queue:
/// see Doorbell.
class PacketQueue {
 public:
  /// Holds at most `packets` (at least 1), and of each kind of sample at most `samples` in one
  /// packet: the oldest beyond are given up, which takes an estimator that stands still for long.
  PacketQueue(std::size_t packets, std::size_t samples);

  void push(SyncedPacket packet);

  /// The oldest packet, or nothing when empty.
  [[nodiscard]] std::optional<SyncedPacket> try_pop();

  /// Packets whose images were given up so far.
  [[nodiscard]] std::uint64_t dropped() const;

 private:
  mutable std::mutex mutex_;
  std::size_t capacity_;
  std::size_t samples_;
  std::vector<SyncedPacket> packets_;  // the oldest first
  std::uint64_t dropped_ = 0;
};

}  // namespace geoflow::timesync
