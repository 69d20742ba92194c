#include "view/web_server.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <fmt/core.h>
#include <microhttpd.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/types.h>

#include "geoflow/hal/result.hpp"

#include "view/live_state.hpp"

namespace geoflow::tools {
namespace {

constexpr unsigned kMostConnections = 32;
constexpr std::size_t kConnectionBytes = 8192;  ///< of a request's head
constexpr unsigned kIdleSeconds = 10;
constexpr auto kHeartbeat = std::chrono::seconds{1};
constexpr std::size_t kEventBlock = 16'384;

/// A numeric address as the system's calls take it.
struct SocketAddress {
  sockaddr_storage storage{};
  bool v6 = false;
  bool loopback = false;

  [[nodiscard]] const sockaddr* get() const noexcept {
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): as POSIX has it
    return reinterpret_cast<const sockaddr*>(&storage);
  }
};

std::optional<SocketAddress> parse_address(const std::string& text, std::uint16_t port) {
  SocketAddress address;
  sockaddr_in v4{};
  sockaddr_in6 v6{};
  if (::inet_pton(AF_INET, text.c_str(), &v4.sin_addr) == 1) {
    constexpr std::uint32_t kLoopbackNet = 127;
    constexpr unsigned kNetShift = 24;
    v4.sin_family = AF_INET;
    v4.sin_port = htons(port);
    address.loopback = ntohl(v4.sin_addr.s_addr) >> kNetShift == kLoopbackNet;
    std::memcpy(&address.storage, &v4, sizeof v4);
    return address;
  }
  if (::inet_pton(AF_INET6, text.c_str(), &v6.sin6_addr) == 1) {
    v6.sin6_family = AF_INET6;
    v6.sin6_port = htons(port);
    address.v6 = true;
    address.loopback = IN6_IS_ADDR_LOOPBACK(&v6.sin6_addr) != 0;
    std::memcpy(&address.storage, &v6, sizeof v6);
    return address;
  }
  return std::nullopt;
}

/// Takes as long for any guess of the same length.
bool same_secret(std::string_view guess, std::string_view secret) {
  unsigned difference = guess.size() == secret.size() ? 0U : 1U;
  for (std::size_t i = 0; i < std::min(guess.size(), secret.size()); ++i) {
    difference |= static_cast<unsigned>(guess[i] ^ secret[i]);
  }
  return difference == 0;
}

std::string_view value_of(MHD_Connection* connection, MHD_ValueKind kind, const char* key) {
  const char* value = ::MHD_lookup_connection_value(connection, kind, key);
  return value != nullptr ? value : std::string_view{};
}

/// One page that is being told events.
struct EventStream {
  LiveState& state;
  PageProgress progress{};
  std::string pending{};
};

/// libmicrohttpd's reader of a stream: called on the connection's own thread.
ssize_t read_events(void* context, std::uint64_t /*position*/, char* buffer, std::size_t size) {
  auto& stream = *static_cast<EventStream*>(context);
  if (stream.pending.empty()) {
    stream.pending = stream.state.next(stream.progress, kHeartbeat);
  }
  if (stream.pending.empty()) {
    return MHD_CONTENT_READER_END_OF_STREAM;
  }
  const std::size_t count = stream.pending.copy(buffer, size);
  stream.pending.erase(0, count);
  return static_cast<ssize_t>(count);
}

void free_events(void* context) {
  const std::unique_ptr<EventStream> owned{static_cast<EventStream*>(context)};
}

MHD_Result answer(MHD_Connection* connection, unsigned status, const char* type,
                  MHD_Response* response) {
  for (const auto& [name, value] :
       {std::pair{"Content-Type", type},
        {"Cache-Control", "no-store"},
        {"X-Content-Type-Options", "nosniff"},
        {"Referrer-Policy", "no-referrer"},
        {"Content-Security-Policy",
         "default-src 'none'; connect-src 'self'; img-src data:; style-src 'unsafe-inline'; "
         "script-src "
         "'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"}}) {
    ::MHD_add_response_header(response, name, value);
  }
  const MHD_Result queued = ::MHD_queue_response(connection, status, response);
  ::MHD_destroy_response(response);
  return queued;
}

MHD_Result answer_text(MHD_Connection* connection, unsigned status, const char* type,
                       std::string text) {
  // The library copies what it is given; its parameter only lacks the const.
  return answer(connection, status, type,
                ::MHD_create_response_from_buffer(text.size(), text.data(), MHD_RESPMEM_MUST_COPY));
}

/// Bytes that others share stay where they are until they are sent.
MHD_Result answer_shared(MHD_Connection* connection, const char* type,
                         const std::shared_ptr<const std::string>& bytes) {
  using Shared = std::shared_ptr<const std::string>;
  auto kept = std::make_unique<Shared>(bytes);
  const auto free = [](void* context) {
    const std::unique_ptr<Shared> owned{static_cast<Shared*>(context)};
  };
  // Its parameter lacks the const, as in the call above.
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast)
  void* data = const_cast<char*>(bytes->data());
  return answer(connection, MHD_HTTP_OK, type,
                ::MHD_create_response_from_buffer_with_free_callback_cls(bytes->size(), data, free,
                                                                         kept.release()));
}

}  // namespace

bool is_loopback(const std::string& address) {
  const auto parsed = parse_address(address, 0);
  return parsed && parsed->loopback;
}

class WebServer::Implementation {
 public:
  Implementation(const WebServerOptions& options, std::vector<Resource> resources, LiveState& state)
      : options_{options}, resources_{std::move(resources)}, state_{state} {}
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;
  ~Implementation() {
    state_.close();
    if (daemon_ != nullptr) {
      ::MHD_stop_daemon(daemon_);
    }
  }

  [[nodiscard]] Result<void> start() {
    const auto address = parse_address(options_.address, options_.port);
    if (!address) {
      return fail(ErrorCode::kInvalidArgument, "{}: not a numeric IPv4 or IPv6 address",
                  options_.address);
    }
    loopback_ = address->loopback;
    if (!loopback_ && options_.token.empty()) {
      return fail(ErrorCode::kInvalidArgument, "{}: beyond loopback a token is needed",
                  options_.address);
    }
    unsigned flags = MHD_USE_INTERNAL_POLLING_THREAD | MHD_USE_THREAD_PER_CONNECTION | MHD_USE_POLL;
    if (address->v6) {
      flags |= MHD_USE_IPv6;
    }
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-vararg): the library's only way in
    daemon_ = ::MHD_start_daemon(
        flags, options_.port, nullptr, nullptr, &handle, this, MHD_OPTION_SOCK_ADDR, address->get(),
        MHD_OPTION_CONNECTION_LIMIT, kMostConnections, MHD_OPTION_CONNECTION_MEMORY_LIMIT,
        2 * kConnectionBytes, MHD_OPTION_CONNECTION_TIMEOUT, kIdleSeconds, MHD_OPTION_END);
    if (daemon_ == nullptr) {
      return fail(ErrorCode::kUnavailable,
                  "{}, port {}: cannot be listened at; is the port taken, is the address this "
                  "machine's?",
                  options_.address, options_.port);
    }
    const MHD_DaemonInfo* info = ::MHD_get_daemon_info(daemon_, MHD_DAEMON_INFO_BIND_PORT);
    port_ = info != nullptr ? info->port : options_.port;
    authority_ = address->v6 ? fmt::format("[{}]:{}", options_.address, port_)
                             : fmt::format("{}:{}", options_.address, port_);
    return {};
  }

  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  [[nodiscard]] std::string url() const {
    return fmt::format("http://{}/{}{}", authority_,
                       options_.token.empty() ? "" : "?token=", options_.token);
  }

 private:
  static MHD_Result handle(void* self, MHD_Connection* connection, const char* url,
                           const char* method, const char* /*version*/, const char* /*data*/,
                           std::size_t* /*size*/, void** /*context*/) {
    return static_cast<Implementation*>(self)->answer_request(connection, url, method);
  }

  [[nodiscard]] bool host_is_ours(std::string_view host) const {
    return !loopback_ || host == authority_ || host == fmt::format("localhost:{}", port_);
  }

  [[nodiscard]] MHD_Result answer_request(MHD_Connection* connection, std::string_view url,
                                          std::string_view method) const {
    const auto refuse = [&](unsigned status, const char* why) {
      return answer_text(connection, status, "text/plain; charset=utf-8", why);
    };
    const std::string_view host = value_of(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_HOST);
    const std::string_view origin = value_of(connection, MHD_HEADER_KIND, MHD_HTTP_HEADER_ORIGIN);
    if (!host_is_ours(host)) {
      return refuse(MHD_HTTP_FORBIDDEN, "This name is not the server's.\n");
    }
    if (!origin.empty() && origin != fmt::format("http://{}", host)) {
      return refuse(MHD_HTTP_FORBIDDEN, "Pages of other sites may not ask here.\n");
    }
    if (!same_secret(value_of(connection, MHD_GET_ARGUMENT_KIND, "token"), options_.token)) {
      return refuse(MHD_HTTP_UNAUTHORIZED, "The token is missing or wrong.\n");
    }
    if (method != MHD_HTTP_METHOD_GET) {
      return refuse(MHD_HTTP_METHOD_NOT_ALLOWED, "Only GET is answered.\n");
    }
    if (url == "/events") {
      return answer_events(connection);
    }
    const auto resource = std::ranges::find(resources_, url, &Resource::path);
    if (resource == resources_.end()) {
      return refuse(MHD_HTTP_NOT_FOUND, "There is no such page.\n");
    }
    const auto content = resource->content();
    return content ? answer_shared(connection, resource->type.c_str(), *content)
                   : refuse(MHD_HTTP_NOT_FOUND, content.error().message.c_str());
  }

  [[nodiscard]] MHD_Result answer_events(MHD_Connection* connection) const {
    auto stream = std::make_unique<EventStream>(EventStream{.state = state_});
    MHD_Response* response = ::MHD_create_response_from_callback(
        MHD_SIZE_UNKNOWN, kEventBlock, &read_events, stream.release(), &free_events);
    return answer(connection, MHD_HTTP_OK, "text/event-stream", response);
  }

  WebServerOptions options_;
  const std::vector<Resource> resources_;
  LiveState& state_;
  MHD_Daemon* daemon_ = nullptr;
  bool loopback_ = true;
  std::uint16_t port_ = 0;
  std::string authority_;
};

WebServer::WebServer(std::unique_ptr<Implementation> implementation)
    : implementation_{std::move(implementation)} {}
WebServer::WebServer(WebServer&& other) noexcept = default;
WebServer& WebServer::operator=(WebServer&& other) noexcept = default;
WebServer::~WebServer() = default;

Result<WebServer> WebServer::start(const WebServerOptions& options, std::vector<Resource> resources,
                                   LiveState& state) {
  auto implementation = std::make_unique<Implementation>(options, std::move(resources), state);
  return implementation->start().map([&] { return WebServer{std::move(implementation)}; });
}

std::uint16_t WebServer::port() const noexcept {
  return implementation_->port();
}

std::string WebServer::url() const {
  return implementation_->url();
}

}  // namespace geoflow::tools
