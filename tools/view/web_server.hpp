#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "view/live_state.hpp"

namespace geoflow::tools {

struct WebServerOptions {
  std::string address = "127.0.0.1";  ///< numeric, IPv4 or IPv6
  std::uint16_t port = 0;             ///< 0: any that is free
  /// What a request must have as `?token=`; empty: none needed, which only a loopback address may
  /// have.
  std::string token{};
};

/// Whether a numeric address is of this machine alone; false for what is no address.
[[nodiscard]] bool is_loopback(const std::string& address);

/// What is served at one path.
struct Resource {
  std::string path;  ///< begins with `/`
  std::string type;  ///< Content-Type
  /// Its bytes as they are now, asked for on a thread of the server; an error is told with status
  /// 404.
  std::function<Result<std::shared_ptr<const std::string>>()> content;
};

/// Serves resources, and at `/events` the server-sent events of a LiveState, with libmicrohttpd, on
/// threads of that library. Refused, each with a status and a sentence: another path (404) or
/// method (405); a Host that is not this server's, where it listens on loopback, or an Origin that
/// is not the page's own (403: a page of another site, also by DNS rebinding); a missing or wrong
/// token (401). A request that is no HTTP, or whose head is over 8 KiB, one that is not whole
/// within 10 s and the 33rd connection are closed. Bodies are not read.
class WebServer {
 public:
  /// Starts it. `state` must outlive it. Errors: an address that is none or is not this machine's,
  /// one beyond loopback without a token, a port that is taken.
  [[nodiscard]] static Result<WebServer> start(const WebServerOptions& options,
                                               std::vector<Resource> resources, LiveState& state);

  WebServer(WebServer&& other) noexcept;
  WebServer& operator=(WebServer&& other) noexcept;
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;
  /// Closes the state and all connections.
  ~WebServer();

  /// Where it listens.
  [[nodiscard]] std::uint16_t port() const noexcept;
  /// What a browser opens, with the token.
  [[nodiscard]] std::string url() const;

 private:
  class Implementation;
  explicit WebServer(std::unique_ptr<Implementation> implementation);
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace geoflow::tools
