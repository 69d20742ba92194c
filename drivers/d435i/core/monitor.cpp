#include "d435i/core/monitor.hpp"

#include <array>
#include <chrono>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "d435i/core/transport.hpp"
#include "d435i/monitor/command.hpp"

namespace geoflow::drivers::d435i {
namespace {

// As librealsense waits (src/platform/uvc-option.cpp, src/libuvc).
constexpr Duration kRetryAfter = std::chrono::milliseconds{10};
constexpr int kTries = 100;

class Dropping final : public TransportSink {
 public:
  void on_frame(const RawFrame& /*frame*/) override {}
  void on_imu(const RawImu& /*imu*/) override {}
  void on_damaged_frame(VideoStream /*stream*/, std::string_view /*why*/) override {}
  void on_damaged_imu(std::string_view /*why*/) override {}
};

/// Calls `attempt` until it does not answer kUnavailable.
template <typename Attempt>
auto with_retries(Transport& transport, const Attempt& attempt) {
  Dropping nowhere;
  auto done = attempt();
  for (int i = 1; i < kTries && !done && done.error().code == ErrorCode::kUnavailable; ++i) {
    if (auto waited = transport.poll(kRetryAfter, nowhere); !waited) {
      done = tl::unexpected{std::move(waited.error())};
      break;
    }
    done = attempt();
  }
  return done;
}

}  // namespace

Result<std::vector<std::byte>> ask_monitor(Transport& transport, const MonitorCommand& command) {
  const auto request = encode_command(command);
  auto sent =
      with_retries(transport, [&] { return transport.set_control(kMonitorSelector, request); });
  if (!sent) {
    return tl::unexpected{std::move(sent.error())};
  }
  std::array<std::byte, kMonitorBytes> reply{};
  return with_retries(transport, [&] {
    return transport.get_control(kMonitorSelector, reply)
        .and_then([&] { return parse_reply(reply, command.opcode); })
        .map([](auto data) { return std::vector<std::byte>{data.begin(), data.end()}; });
  });
}

Result<void> send_hardware_reset(Transport& transport) {
  return transport.set_control(kMonitorSelector,
                               encode_command({.opcode = Opcode::kHardwareReset}));
}

}  // namespace geoflow::drivers::d435i
