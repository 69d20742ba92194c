#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <list>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/core.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"
#include "geoflow/tools/emulator/usbip_server.hpp"

#include "src/messages.hpp"
#include "src/session.hpp"
#include "src/vhci.hpp"

namespace geoflow::emulator {
namespace {

using usbip::Announcement;
using usbip::Operation;
using usbip::Session;

constexpr std::size_t kMostClients = 8;
constexpr std::size_t kReadSize = std::size_t{64} << 10U;

/// One connection: first it asks, then it may have the device.
struct Client {
  UniqueFd fd;
  Bytes input{};   ///< while it asks
  Bytes output{};  ///< answers to that
  std::optional<Session> session{};
  bool ended = false;
};

/// The device's own descriptors, as a host would read them.
Result<Announcement> announcement_of(UsbDevice& device, HostTime now) {
  constexpr std::uint8_t kIn = 0x80;
  constexpr std::uint8_t kGetDescriptor = 6;
  const auto read = [&](std::uint16_t value) {
    return device.control(
        {.request_type = kIn, .request = kGetDescriptor, .value = value, .length = UINT16_MAX}, {},
        now);
  };
  constexpr std::uint16_t kDevice = 0x0100;
  constexpr std::uint16_t kConfiguration = 0x0200;
  constexpr std::size_t kDeviceSize = 18;
  constexpr std::size_t kConfigurationSize = 9;
  auto device_bytes = read(kDevice);
  auto configuration = read(kConfiguration);
  if (!device_bytes || device_bytes->size() < kDeviceSize || !configuration ||
      configuration->size() < kConfigurationSize) {
    return fail(ErrorCode::kInvalidData, "the emulated device does not say what it is");
  }
  return Announcement{.bus_id = UsbIpServer::kBusId,
                      .speed = device.speed(),
                      .device = std::move(*device_bytes),
                      .configuration = std::move(*configuration)};
}

class Server final : public UsbIpServer {
 public:
  explicit Server(UsbDevice& device) : device_{device} {}

  [[nodiscard]] Result<void> open(std::uint16_t port);
  [[nodiscard]] Result<void> plug_in();

  [[nodiscard]] std::uint16_t port() const override { return port_; }
  [[nodiscard]] bool attached() const override {
    return std::ranges::any_of(clients_,
                               [](const Client& client) { return client.session.has_value(); });
  }
  [[nodiscard]] Result<void> serve(Duration at_most) override;

 private:
  void accept_one();
  void receive(Client& client, HostTime now);
  void take(Client& client, std::span<const std::byte> bytes, HostTime now);
  void greet(Client& client, HostTime now);
  void begin(Client& client, HostTime now);
  static void send(Client& client);
  void drop_ended(HostTime now);
  void unplug();
  [[nodiscard]] HostTime next_due(HostTime now);
  [[nodiscard]] std::vector<pollfd> waiting() const;

  UsbDevice& device_;
  UniqueFd listener_;
  std::uint16_t port_ = 0;
  bool local_ = false;
  std::list<Client> clients_;
};

Result<void> Server::open(std::uint16_t port) {
  UniqueFd fd{socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
  if (!fd) {
    return fail_errno("socket");
  }
  const int on = 1;
  (void)setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  // NOLINTBEGIN(cppcoreguidelines-pro-type-reinterpret-cast): the sockets' own way of naming
  // addresses
  auto* any = reinterpret_cast<sockaddr*>(&address);
  // NOLINTEND(cppcoreguidelines-pro-type-reinterpret-cast)
  if (bind(fd.get(), any, size) != 0 || ::listen(fd.get(), kMostClients) != 0 ||
      getsockname(fd.get(), any, &size) != 0) {
    return fail_errno(fmt::format("port {} of 127.0.0.1", port));
  }
  port_ = ntohs(address.sin_port);
  listener_ = std::move(fd);
  return {};
}

Result<void> Server::plug_in() {
  auto fd = usbip::attach_to_kernel(device_.speed());
  if (!fd) {
    return tl::unexpected{std::move(fd.error())};
  }
  local_ = true;
  (void)fcntl(fd->get(), F_SETFL, O_NONBLOCK);
  begin(clients_.emplace_back(Client{.fd = std::move(*fd)}), HostClock::now());
  return {};
}

void Server::accept_one() {
  UniqueFd fd{accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)};
  if (!fd || clients_.size() == kMostClients) {
    return;  // gone again, or one too many: closed
  }
  const int on = 1;
  (void)setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  clients_.push_back(Client{.fd = std::move(fd)});
}

void Server::begin(Client& client, HostTime now) {
  client.session.emplace(device_, now);
}

void Server::greet(Client& client, HostTime now) {
  while (!client.session && !client.ended && client.input.size() >= usbip::kOperationHeaderSize) {
    const auto operation = usbip::decode_operation(client.input);
    const auto device = announcement_of(device_, now);
    if (!operation || !device) {
      log::warning("usbip", "{}", (operation ? device.error() : operation.error()).message);
      client.ended = true;
      return;
    }
    const bool import = *operation == Operation::kImport;
    const std::size_t size = usbip::kOperationHeaderSize + (import ? usbip::kBusIdSize : 0);
    if (client.input.size() < size) {
      return;
    }
    std::array<char, usbip::kBusIdSize + 1> bus_id{};
    std::memcpy(bus_id.data(), client.input.data() + usbip::kOperationHeaderSize,
                size - usbip::kOperationHeaderSize);
    const bool found = import && std::string_view{bus_id.data()} == kBusId && !attached();
    const Bytes reply = import ? usbip::import_reply(*device, found) : usbip::list_reply(*device);
    client.output.insert(client.output.end(), reply.begin(), reply.end());
    client.input.erase(client.input.begin(),
                       client.input.begin() + static_cast<std::ptrdiff_t>(size));
    if (found) {
      begin(client, now);
    }
  }
}

void Server::take(Client& client, std::span<const std::byte> bytes, HostTime now) {
  if (!client.session) {
    client.input.insert(client.input.end(), bytes.begin(), bytes.end());
    greet(client, now);
    if (!client.session) {
      return;
    }
    const Bytes rest = std::exchange(client.input, {});
    return take(client, rest, now);
  }
  if (auto fed = client.session->feed(bytes, now); !fed) {
    log::warning("usbip", "the host was cut off: {}", fed.error().message);
    client.ended = true;
  }
}

void Server::receive(Client& client, HostTime now) {
  std::array<std::byte, kReadSize> buffer{};
  const ssize_t count = recv(client.fd.get(), buffer.data(), buffer.size(), 0);
  if (count > 0) {
    take(client, std::span{buffer}.first(static_cast<std::size_t>(count)), now);
  } else if (count == 0 || (errno != EAGAIN && errno != EINTR)) {
    client.ended = true;
  }
}

void Server::send(Client& client) {
  const auto send_some = [&](std::span<const std::byte> bytes) {
    const ssize_t count = ::send(client.fd.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count < 0 && errno != EAGAIN && errno != EINTR) {
      client.ended = true;
    }
    return static_cast<std::size_t>(std::max<ssize_t>(count, 0));
  };
  if (!client.output.empty()) {
    const std::size_t count = send_some(client.output);
    client.output.erase(client.output.begin(),
                        client.output.begin() + static_cast<std::ptrdiff_t>(count));
  } else if (client.session && !client.session->output().empty()) {
    client.session->sent(send_some(client.session->output()));
  }
}

void Server::drop_ended(HostTime now) {
  const bool had = attached();
  clients_.remove_if([](const Client& client) { return client.ended; });
  if (had && !attached()) {
    device_.reset(now);
  }
}

void Server::unplug() {
  for (Client& client : clients_) {
    client.ended = client.ended || client.session.has_value();
  }
}

HostTime Server::next_due(HostTime now) {
  if (!device_.connected(now)) {
    return device_.next_due(0, now);
  }
  HostTime due = HostTime::max();
  for (Client& client : clients_) {
    if (client.session) {
      due = std::min(due, client.session->next_due(now));
    }
  }
  return due;
}

std::vector<pollfd> Server::waiting() const {
  std::vector<pollfd> polled;
  for (const Client& client : clients_) {
    const bool to_send =
        !client.output.empty() || (client.session && !client.session->output().empty());
    polled.push_back({client.fd.get(), static_cast<short>(to_send ? POLLIN | POLLOUT : POLLIN), 0});
  }
  if (listener_) {
    polled.push_back({listener_.get(), POLLIN, 0});
  }
  return polled;
}

Result<void> Server::serve(Duration at_most) {
  HostTime now = HostClock::now();
  if (local_ && clients_.empty() && device_.connected(now)) {
    if (auto plugged = plug_in(); !plugged) {
      return plugged;
    }
  }
  std::vector<pollfd> polled = waiting();
  constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;
  const HostTime due = next_due(now);
  const Duration wait =
      due == HostTime::max() ? at_most : std::clamp<Duration>(due - now, Duration::zero(), at_most);
  const timespec timeout{.tv_sec = wait.count() / kNanosecondsPerSecond,
                         .tv_nsec = wait.count() % kNanosecondsPerSecond};
  if (ppoll(polled.data(), polled.size(), &timeout, nullptr) < 0) {
    return errno == EINTR ? Result<void>{} : fail_errno("ppoll");
  }
  now = HostClock::now();
  std::size_t index = 0;
  for (Client& client : clients_) {
    if ((polled[index].revents & (POLLIN | POLLERR | POLLHUP)) != 0) {
      receive(client, now);
    }
    ++index;
    if (client.session && !client.ended) {
      client.session->serve(now);
    }
    send(client);
  }
  if (listener_ && (polled[index].revents & POLLIN) != 0) {
    accept_one();
  }
  if (!device_.connected(now)) {
    unplug();
  }
  drop_ended(now);
  return {};
}

}  // namespace

Result<std::unique_ptr<UsbIpServer>> UsbIpServer::listen(UsbDevice& device, std::uint16_t port) {
  auto server = std::make_unique<Server>(device);
  if (auto opened = server->open(port); !opened) {
    return tl::unexpected{std::move(opened.error())};
  }
  return server;
}

Result<std::unique_ptr<UsbIpServer>> UsbIpServer::attach(UsbDevice& device) {
  auto server = std::make_unique<Server>(device);
  if (auto plugged = server->plug_in(); !plugged) {
    return tl::unexpected{std::move(plugged.error())};
  }
  return server;
}

}  // namespace geoflow::emulator
