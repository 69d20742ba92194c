#pragma once

#include <optional>
#include <string>

#include <CLI/App.hpp>
#include <nlohmann/json_fwd.hpp>

#include "geoflow/daemon/control_client.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::tools {

/// The daemon that a verb speaks with by its control socket. Thread-bound.
class LiveClient {
 public:
  /// Declares --socket.
  void declare(CLI::App& command);

  /// Connects to the socket that the command line names. Errors as ControlClient::connect().
  [[nodiscard]] Result<void> connect();
  [[nodiscard]] const std::string& socket() const noexcept { return socket_; }

  /// The reply to a request, once connected, within a minute: a map may be large and a disk slow.
  /// Errors as ControlClient::request().
  [[nodiscard]] Result<nlohmann::json> ask(const nlohmann::json& request);
  /// The reply's `status`.
  [[nodiscard]] Result<nlohmann::json> status();

  /// connect() and ask(), for verbs that ask once.
  [[nodiscard]] Result<nlohmann::json> ask_once(const nlohmann::json& request);

 private:
  std::string socket_ = default_socket();
  std::optional<daemon::ControlClient> client_;

  [[nodiscard]] static std::string default_socket();
};

}  // namespace geoflow::tools
