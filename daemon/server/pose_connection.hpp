#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/time.hpp"

#include "server/acceptor.hpp"
#include "server/token_bucket.hpp"
#include "stream/frame_streams.hpp"

namespace geoflow::daemon {

/// One client of the pose socket: its handshake, the one pose that may wait for it, and its
/// counters. Never blocks. Thread-bound: the loop's.
class PoseConnection {
 public:
  PoseConnection(Connection connection, std::uint32_t id, HostTime now);

  enum class Outcome : std::uint8_t {
    kOpen,      ///< goes on
    kFinished,  ///< nothing more to say; close it
    kLost,      ///< gone, or broke the rules; close it
  };

  /// Takes the next datagrams of the client, the HELLO among them.
  [[nodiscard]] Outcome receive(const geoflow_welcome& welcome, HostTime now);
  /// Sends the pose, if it is of a kind that the client wants, or keeps it as the one that waits
  /// (in the place of an older one, which counts as dropped).
  [[nodiscard]] Outcome offer(const geoflow_pose& pose, HostTime now);
  /// Tells that a frame is there, if the client wants its stream and has room; before the first one
  /// of a ring, hands that over. No frame waits: one that finds no room counts as dropped.
  [[nodiscard]] Outcome offer(const StreamedFrame& streamed, HostTime now);
  /// Sends what waits. To be called when the socket is writable again.
  [[nodiscard]] Outcome flush(HostTime now);
  /// Says that nothing more follows, after what waits.
  [[nodiscard]] Outcome finish(geoflow_end_reason reason, HostTime now);
  /// Refuses a client that is not yet welcome.
  void refuse(geoflow_refusal reason, const std::string& text);

  [[nodiscard]] int fd() const noexcept { return connection_.fd.get(); }
  [[nodiscard]] bool welcomed() const noexcept { return welcomed_; }
  /// True while something waits for the socket to become writable.
  [[nodiscard]] bool blocked() const noexcept {
    return pending_.has_value() || starved_ || (ending_ && !ended_);
  }
  /// Since when nothing could be sent (only while blocked()) or, before HELLO, since it connected.
  [[nodiscard]] HostTime waiting_since() const noexcept { return waiting_since_; }
  /// Of which streams it wants frames (geoflow_want, or-ed).
  [[nodiscard]] std::uint32_t wanted_frames() const noexcept { return wants_frames_; }
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] const Connection& peer() const noexcept { return connection_; }
  [[nodiscard]] std::uint32_t id() const noexcept { return id_; }
  [[nodiscard]] std::uint64_t sent() const noexcept { return sent_; }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  enum class Sent : std::uint8_t { kYes, kFull, kBroken };
  /// What it has had of one stream of frames.
  struct FrameStream {
    RateLimit rate{0};
    std::uint64_t ring = 0;  // that it has been given; 0: none
    std::uint32_t dropped_since_last = 0;
  };
  [[nodiscard]] bool wants(const geoflow_pose& pose) const noexcept;
  [[nodiscard]] Outcome greet(std::span<const std::byte> datagram, const geoflow_welcome& welcome);
  /// `passed`: a descriptor that goes with the record; -1: none.
  [[nodiscard]] Sent send(std::span<const std::byte> record, int passed = -1);
  [[nodiscard]] Sent send_frame(const StreamedFrame& streamed, FrameStream& stream);
  [[nodiscard]] Sent send_pose(const geoflow_pose& pose);
  [[nodiscard]] Outcome send_end(geoflow_end_reason reason);

  Connection connection_;
  std::uint32_t id_;
  std::string name_;
  bool welcomed_ = false;
  bool wants_pose_ = false;
  bool wants_propagated_ = false;
  std::int64_t newest_capture_ns_ = std::numeric_limits<std::int64_t>::min();  ///< offered
  RateLimit rate_{0};
  TokenBucket requests_;
  std::optional<geoflow_pose> pending_;
  std::uint32_t wants_frames_ = 0;
  std::map<std::uint32_t, FrameStream> frames_;  // by stream
  bool starved_ = false;                         // a frame found no room
  std::optional<geoflow_end_reason> ending_;
  bool ended_ = false;
  HostTime waiting_since_;
  std::uint64_t sent_ = 0;
  std::uint64_t dropped_ = 0;
  std::uint32_t dropped_since_last_ = 0;
};

}  // namespace geoflow::daemon
