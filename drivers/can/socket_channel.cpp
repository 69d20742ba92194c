#include "can/socket_channel.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

#include "can/channel.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "can/socket_reader.hpp"

namespace geoflow::drivers::can {
namespace {

constexpr int kReceiveBuffer = 1 << 20;  // a second of a full bus at 1 Mbit/s, with room
constexpr can_err_mask_t kErrorReports = CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_BUSOFF |
                                         CAN_ERR_RESTARTED | CAN_ERR_BUSERROR | CAN_ERR_ACK;

tl::unexpected<Error> refused(std::string_view interface, std::string_view what) {
  const int error = errno;
  return fail(ErrorCode::kSystem, "{}: {}: {}", interface, what,
              std::generic_category().message(error));
}

/// The names of all CAN interfaces, for messages.
std::string can_interfaces(int socket) {
  std::string names;
  const std::unique_ptr<struct if_nameindex, void (*)(struct if_nameindex*)> all{
      ::if_nameindex(), ::if_freenameindex};
  for (const struct if_nameindex* entry = all.get(); entry != nullptr && entry->if_index != 0;
       ++entry) {
    ifreq request{};
    std::strncpy(request.ifr_name, entry->if_name, IFNAMSIZ - 1);
    if (::ioctl(socket, SIOCGIFHWADDR, &request) == 0 &&
        request.ifr_hwaddr.sa_family == ARPHRD_CAN) {
      names.append(names.empty() ? "" : ", ").append(entry->if_name);
    }
  }
  return names.empty() ? "there is none" : "there are: " + names;
}

/// The interface's number, if it is one for CAN and up.
Result<int> usable_interface(int socket, const std::string& interface) {
  ifreq request{};
  if (interface.empty() || interface.size() >= IFNAMSIZ) {
    return fail(ErrorCode::kInvalidArgument, "'{}' is no name of a network interface", interface);
  }
  interface.copy(request.ifr_name, IFNAMSIZ - 1);
  if (::ioctl(socket, SIOCGIFHWADDR, &request) != 0) {
    return fail(ErrorCode::kNotFound,
                "{}: no such network interface; of those for CAN, {}. Is the adapter plugged in?",
                interface, can_interfaces(socket));
  }
  if (request.ifr_hwaddr.sa_family != ARPHRD_CAN) {
    return fail(ErrorCode::kUnsupported, "{}: the wrong interface: not one for CAN; of those, {}",
                interface, can_interfaces(socket));
  }
  if (::ioctl(socket, SIOCGIFFLAGS, &request) != 0) {
    return refused(interface, "its state cannot be read");
  }
  if ((static_cast<unsigned>(request.ifr_flags) & IFF_UP) == 0) {
    return fail(
        ErrorCode::kUnavailable,
        "{}: is down; `ip link set {} up type can bitrate 1000000 restart-ms 100` brings it "
        "up",
        interface, interface);
  }
  if (::ioctl(socket, SIOCGIFINDEX, &request) != 0) {
    return refused(interface, "it has no number");
  }
  return request.ifr_ifindex;
}

template <typename T>
bool set_option(int socket, int level, int option, const T& value) {
  return ::setsockopt(socket, level, option, &value, sizeof value) == 0;
}

/// Lets only these frames through. No filter where there are more than the kernel takes.
void set_filter(int socket, const std::vector<LegDictionary::Identifier>& known, Listen to) {
  std::vector<can_filter> filters;
  if (to == Listen::kToAll || known.size() > CAN_RAW_FILTER_MAX) {
    filters.push_back({.can_id = 0, .can_mask = 0});
  } else {
    for (const auto& identifier : known) {
      // The flags are part of the mask, so that neither 29-bit identifiers nor requests pass for
      // others.
      const auto bits = static_cast<canid_t>(identifier.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
      filters.push_back({.can_id = identifier.id | (identifier.extended ? CAN_EFF_FLAG : 0U),
                         .can_mask = bits | CAN_EFF_FLAG | CAN_RTR_FLAG});
    }
  }
  // Without a filter more comes than is wanted, which does no harm.
  (void)::setsockopt(socket, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(),
                     static_cast<socklen_t>(filters.size() * sizeof(can_filter)));
}

int milliseconds(Duration timeout) {
  return static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(timeout).count());
}

}  // namespace

Result<UniqueFd> open_can_socket(const std::string& interface) {
  UniqueFd socket{::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW)};
  if (!socket) {
    const int error = errno;
    return error == EAFNOSUPPORT || error == EPROTONOSUPPORT
               ? fail(
                     ErrorCode::kUnsupported,
                     "{}: this kernel has no CAN; `modprobe can_raw` loads it where it is a module",
                     interface)
               : fail(ErrorCode::kSystem, "{}: {}", interface,
                      std::generic_category().message(error));
  }
  const auto index = usable_interface(socket.get(), interface);
  if (!index) {
    return tl::unexpected{index.error()};
  }
  if (!set_option(socket.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, 1)) {
    return refused(interface, "CAN FD frames cannot be asked for");
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = *index;
  // NOLINTNEXTLINE(bugprone-casting-through-void): the socket interface's own way
  if (::bind(socket.get(), static_cast<const sockaddr*>(static_cast<const void*>(&address)),
             sizeof address) != 0) {
    return refused(interface, "cannot be listened to");
  }
  return socket;
}

Result<std::unique_ptr<Channel>> SocketChannel::create(
    std::vector<std::string> interfaces, std::vector<LegDictionary::Identifier> known) {
  UniqueFd bell{::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  if (!bell) {
    return fail_errno("eventfd");
  }
  return std::make_unique<SocketChannel>(std::move(interfaces), std::move(known), std::move(bell));
}

SocketChannel::SocketChannel(std::vector<std::string> interfaces,
                             std::vector<LegDictionary::Identifier> known, UniqueFd bell)
    : interfaces_{std::move(interfaces)}, known_{std::move(known)}, bell_{std::move(bell)} {}

Result<void> SocketChannel::open() {
  overflowed_before_ = overflowed();
  buses_.clear();
  std::vector<std::unique_ptr<Bus>> opened;
  for (const std::string& interface : interfaces_) {
    auto socket = open_can_socket(interface);
    if (!socket) {
      return tl::unexpected{std::move(socket.error())};
    }
    const int fd = socket->get();
    // More than the system's limit needs a privilege; without it, its limit is what there is.
    if (!set_option(fd, SOL_SOCKET, SO_RCVBUFFORCE, kReceiveBuffer)) {
      (void)set_option(fd, SOL_SOCKET, SO_RCVBUF, kReceiveBuffer);
    }
    if (!set_option(fd, SOL_SOCKET, SO_TIMESTAMPNS, 1) ||
        !set_option(fd, SOL_SOCKET, SO_RXQ_OVFL, 1) ||
        !set_option(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, kErrorReports)) {
      return refused(interface, "stamps, drop counts or error reports cannot be asked for");
    }
    set_filter(fd, known_, Listen::kToKnown);
    opened.push_back(std::make_unique<Bus>());
    opened.back()->socket = *std::move(socket);
  }
  buses_ = std::move(opened);
  return {};
}

Result<void> SocketChannel::read(std::vector<Received>& frames, Duration timeout) {
  std::vector<pollfd> waiting{{.fd = bell_.get(), .events = POLLIN, .revents = 0}};
  for (const auto& bus : buses_) {
    waiting.push_back({.fd = bus->socket.get(), .events = POLLIN, .revents = 0});
  }
  (void)::poll(waiting.data(), waiting.size(), milliseconds(timeout));
  clear_bell();
  const std::size_t before = frames.size();
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    if (waiting[i + 1].revents == 0) {
      continue;
    }
    auto read =
        buses_[i]->reader.read(buses_[i]->socket.get(), static_cast<std::uint8_t>(i), frames);
    if (!read) {
      return tl::unexpected{std::move(read.error()).in(interfaces_[i])};
    }
  }
  if (buses_.size() > 1) {
    std::ranges::stable_sort(frames.begin() + static_cast<std::ptrdiff_t>(before), frames.end(), {},
                             &Received::t_arrival);
  }
  return {};
}

void SocketChannel::listen(Listen to) {
  for (const auto& bus : buses_) {
    set_filter(bus->socket.get(), known_, to);
  }
}

std::uint64_t SocketChannel::overflowed() const {
  std::uint64_t sum = overflowed_before_;
  for (const auto& bus : buses_) {
    sum += bus->reader.overflowed();
  }
  return sum;
}

void SocketChannel::pause(Duration timeout) {
  pollfd waiting{.fd = bell_.get(), .events = POLLIN, .revents = 0};
  (void)::poll(&waiting, 1, milliseconds(timeout));
  clear_bell();
}

void SocketChannel::clear_bell() noexcept {
  std::uint64_t rung = 0;
  (void)!::read(bell_.get(), &rung, sizeof rung);
}

void SocketChannel::wake() noexcept {
  const std::uint64_t one = 1;
  (void)!::write(bell_.get(), &one, sizeof one);
}

}  // namespace geoflow::drivers::can
