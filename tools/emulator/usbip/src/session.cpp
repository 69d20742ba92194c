#include "src/session.hpp"

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/in_pipe.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/messages.hpp"

namespace geoflow::emulator::usbip {
namespace {

constexpr std::uint8_t kEndpoints = 16;
constexpr std::uint8_t kIn = 0x80;
/// Requests of one endpoint that are open at once; hosts have less than 64.
constexpr std::size_t kMostWaiting = 1024;
/// What may be ready and not sent: a little more than one frame, so that frames wait, and get old,
/// in the device.
constexpr std::size_t kMostOutput = std::size_t{8} << 20U;

bool clears_halt(const SetupPacket& setup) {
  constexpr std::uint8_t kToEndpoint = 0x02;
  constexpr std::uint8_t kClearFeature = 1;
  return setup.request_type == kToEndpoint && setup.request == kClearFeature && setup.value == 0;
}

}  // namespace

Session::Session(UsbDevice& device, HostTime now) : device_{device} {
  device_.reset(now);
  for (std::uint8_t number = 0; number < kEndpoints; ++number) {
    endpoints_.push_back({.pipe = InPipe{device_, static_cast<std::uint8_t>(kIn | number)}});
  }
}

Result<void> Session::feed(std::span<const std::byte> bytes, HostTime now) {
  input_.insert(input_.end(), bytes.begin(), bytes.end());
  std::size_t done = 0;
  while (input_.size() - done >= kUrbHeaderSize) {
    const auto rest = std::span{std::as_const(input_)}.subspan(done);
    const auto command = decode_urb(rest.first(kUrbHeaderSize));
    if (!command) {
      return tl::unexpected{command.error()};
    }
    const std::optional<Submit>& submitted = command->submit;
    const std::size_t data = submitted ? submitted->out_size() : 0;
    if (rest.size() - kUrbHeaderSize < data) {
      break;
    }
    handle(*command, rest.subspan(kUrbHeaderSize, data), now);
    done += kUrbHeaderSize + data;
  }
  input_.erase(input_.begin(), input_.begin() + static_cast<std::ptrdiff_t>(done));
  serve(now);
  return {};
}

void Session::handle(const UrbCommand& command, std::span<const std::byte> out, HostTime now) {
  if (command.submit) {
    submit(*command.submit, out, now);
  } else {
    unlink(command);
  }
}

void Session::submit(const Submit& request, std::span<const std::byte> out, HostTime now) {
  Endpoint& endpoint = endpoints_[request.endpoint];
  if (request.endpoint == 0) {
    control(request, out, now);
  } else if (!request.in || request.length == 0 || endpoint.waiting.size() == kMostWaiting) {
    put_return_submit(request.sequence, -EPIPE, 0, {}, output_);  // there is no endpoint like that
  } else {
    endpoint.waiting.push_back(request);
  }
}

void Session::control(const Submit& request, std::span<const std::byte> out, HostTime now) {
  SetupPacket setup = request.setup;
  setup.length = static_cast<std::uint16_t>(std::min<std::uint32_t>(setup.length, request.length));
  auto data = request.in == setup.is_in() || request.length == 0 ? device_.control(setup, out, now)
                                                                 : std::nullopt;
  if (!data) {
    put_return_submit(request.sequence, -EPIPE, 0, {}, output_);
    return;
  }
  if (clears_halt(setup)) {
    constexpr unsigned kNumber = 0x0f;
    endpoints_[setup.index & kNumber].pipe.clear();
  }
  const std::size_t actual = setup.is_in() ? data->size() : out.size();
  put_return_submit(
      request.sequence, 0, static_cast<std::uint32_t>(actual),
      setup.is_in() ? std::span<const std::byte>{*data} : std::span<const std::byte>{}, output_);
}

void Session::unlink(const UrbCommand& command) {
  std::size_t found = 0;
  for (Endpoint& endpoint : endpoints_) {
    found += std::erase_if(endpoint.waiting, [&](const Submit& waiting) {
      return waiting.sequence == command.unlinked;
    });
  }
  put_return_unlink(command.sequence, found != 0 ? -ECONNRESET : 0, output_);
}

void Session::serve(Endpoint& endpoint, HostTime now) {
  while (!endpoint.waiting.empty() && output().size() < kMostOutput) {
    const Submit& request = endpoint.waiting.front();
    const InTransfer transfer = endpoint.pipe.read(request.length, now);
    if (transfer.status == InStatus::kNothing) {
      return;
    }
    const std::int32_t status = transfer.status == InStatus::kData    ? 0
                                : transfer.status == InStatus::kStall ? -EPIPE
                                                                      : -EPROTO;
    put_return_submit(request.sequence, status, static_cast<std::uint32_t>(transfer.data.size()),
                      transfer.data, output_);
    endpoint.waiting.pop_front();
  }
}

void Session::serve(HostTime now) {
  for (Endpoint& endpoint : endpoints_) {
    serve(endpoint, now);
  }
}

HostTime Session::next_due(HostTime now) {
  HostTime due = HostTime::max();
  if (output().size() < kMostOutput) {
    for (std::size_t number = 0; number < endpoints_.size(); ++number) {
      if (!endpoints_[number].waiting.empty()) {
        due = std::min(due, device_.next_due(static_cast<std::uint8_t>(kIn | number), now));
      }
    }
  }
  return due;
}

std::span<const std::byte> Session::output() const noexcept {
  return std::span{output_}.subspan(output_begin_);
}

void Session::sent(std::size_t count) {
  output_begin_ += count;
  if (output_begin_ == output_.size() || output_begin_ > kMostOutput) {
    output_.erase(output_.begin(), output_.begin() + static_cast<std::ptrdiff_t>(output_begin_));
    output_begin_ = 0;
  }
}

}  // namespace geoflow::emulator::usbip
