#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/bytes.hpp"
#include "d435i/core/transport.hpp"
#include "d435i/imu/reports.hpp"
#include "d435i/uvc/descriptors.hpp"

/// A camera made of a script, on a clock of its own: what a test sets in its members happens.
namespace geoflow::drivers::d435i::tests {

struct ScriptedCamera {
  // What it is.
  std::string serial = "850123050307";
  bool present = true;
  bool super_speed = true;
  Duration away_after_reset = std::chrono::seconds{3};
  std::map<std::uint32_t, Bytes> tables;  ///< by id; filled with the golden ones
  std::optional<Bytes> imu_table{};
  std::optional<Bytes> resolution_list{};

  /// The bytes of frame number n of a stream; none: zeros.
  std::function<Bytes(VideoStream, std::uint32_t, std::size_t)> pixels{};

  // What goes wrong.
  std::array<bool, kVideoStreams> silent{};        ///< no frame comes
  std::array<int, kVideoStreams> silent_starts{};  ///< … after so many starts yet
  bool silent_until_port_reset = false;
  bool silent_until_hardware_reset = false;
  std::array<bool, 2> imu_silent{};
  std::array<bool, kVideoStreams> damaged{};  ///< frames come, but not whole
  bool no_header = false;                     ///< frames come without their payload header
  bool refuse_controls = false;               ///< all but the hardware monitor
  int busy_answers = 0;                       ///< the hardware monitor is not ready so many times

  // What happened.
  HostTime now{std::chrono::seconds{100}};
  std::vector<std::string> calls;  ///< "start depth", "stop colour", "reset", …
  std::vector<HostTime> looks;     ///< when it was looked for
  std::map<std::uint8_t, Bytes> controls;

  // Its own state.
  std::optional<HostTime> away_until{};
  bool streaming_lost = false;              ///< an open transport is of no more use
  std::uint32_t clock_us = 4'294'000'000U;  ///< wraps after a second
  std::uint32_t frame_counter = 0;

  ScriptedCamera();

  /// How a session finds it.
  [[nodiscard]] OpenTransport opener();
  void unplug();
  void plug_in();
  [[nodiscard]] int count(const std::string& call) const;
};

}  // namespace geoflow::drivers::d435i::tests
