#include <cerrno>
#include <cstdint>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include <linux/can.h>
#include <linux/can/raw.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/drivers/leg_emitter.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/leg_encoder.hpp"
#include "can/socket_channel.hpp"
#include "can/socket_reader.hpp"

namespace geoflow::drivers {
namespace {

constexpr int kLongestWaitMs = 100;  // for room in the interface's queue

class CanEmitter final : public LegEmitter {
 public:
  CanEmitter(can::LegDictionary dictionary, bool fd, UniqueFd socket, std::string interface)
      : dictionary_{std::move(dictionary)},
        encoder_{dictionary_, fd},
        socket_{std::move(socket)},
        interface_{std::move(interface)} {}

  Result<void> emit(const EmittedSample& sample) override {
    for (const can::Frame& frame : encoder_.encode(sample.legs, round_, sample.device_time)) {
      if (auto sent = send(can::to_kernel(frame)); !sent) {
        return sent;
      }
    }
    ++round_;
    return {};
  }

 private:
  [[nodiscard]] Result<void> send(const can::KernelFrame& frame) const {
    ssize_t sent = ::write(socket_.get(), frame.bytes.data(), frame.size);
    if (sent < 0 && (errno == EAGAIN || errno == ENOBUFS)) {
      pollfd room{.fd = socket_.get(), .events = POLLOUT, .revents = 0};
      (void)::poll(&room, 1, kLongestWaitMs);
      sent = ::write(socket_.get(), frame.bytes.data(), frame.size);
    }
    if (sent < 0) {
      const int error = errno;
      return fail(ErrorCode::kUnavailable, "{}: {}", interface_,
                  std::generic_category().message(error));
    }
    return {};
  }

  const can::LegDictionary dictionary_;
  can::LegEncoder encoder_;
  UniqueFd socket_;
  std::string interface_;
  std::uint64_t round_ = 0;
};

}  // namespace

Result<std::unique_ptr<LegEmitter>> open_can_emitter(const CanEmitterOptions& options) {
  auto dictionary = can::LegDictionary::load(options.dictionary);
  if (!dictionary) {
    return tl::unexpected{std::move(dictionary.error())};
  }
  auto socket = can::open_can_socket(options.interface);
  if (!socket) {
    return tl::unexpected{std::move(socket.error())};
  }
  // It only sends: nothing may pile up in its receive queue.
  const can_filter none{};
  (void)::setsockopt(socket->get(), SOL_CAN_RAW, CAN_RAW_FILTER, &none, 0);
  return std::make_unique<CanEmitter>(*std::move(dictionary), options.fd, *std::move(socket),
                                      options.interface);
}

}  // namespace geoflow::drivers
