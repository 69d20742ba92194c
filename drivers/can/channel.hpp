#pragma once

#include <cstdint>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "can/frame.hpp"

namespace geoflow::drivers::can {

/// Which frames are let through.
enum class Listen : std::uint8_t {
  kToKnown,  ///< to identifiers of the dictionary, and error reports
  kToAll,    ///< to all: to find out what else there is
};

/// Where frames come from: CAN interfaces of the kernel, or a script in tests. Thread-bound, but
/// for wake().
class Channel {
 public:
  Channel() = default;
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;
  virtual ~Channel() = default;

  /// Opens, or opens again; listens to what is known. The error says what is missing and how to
  /// mend it.
  [[nodiscard]] virtual Result<void> open() = 0;
  /// Waits up to `timeout` for frames and adds those there are. An error means that it must be
  /// opened again.
  [[nodiscard]] virtual Result<void> read(std::vector<Received>& frames, Duration timeout) = 0;
  virtual void listen(Listen to) = 0;
  /// Frames that the kernel dropped because they were not read in time, since it was made.
  [[nodiscard]] virtual std::uint64_t overflowed() const = 0;
  /// Waits, with or without being open, until `timeout` is over or wake() is called.
  virtual void pause(Duration timeout) = 0;
  /// Any thread: ends the wait of read() or pause(), of the next one if there is none now.
  virtual void wake() noexcept = 0;
};

}  // namespace geoflow::drivers::can
