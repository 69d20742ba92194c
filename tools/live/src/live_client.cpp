#include "geoflow/tools/live_client.hpp"

#include <chrono>
#include <string>
#include <utility>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include "geoflow/daemon/config.hpp"
#include "geoflow/daemon/control_client.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

constexpr auto kReplyTimeout = std::chrono::minutes{1};

}  // namespace

std::string LiveClient::default_socket() {
  return daemon::SocketConfig{}.control.string();
}

void LiveClient::declare(CLI::App& command) {
  command.add_option("--socket", socket_, "The daemon's control socket")->capture_default_str();
}

Result<void> LiveClient::connect() {
  auto client = daemon::ControlClient::connect(socket_);
  return std::move(client).map([this](auto connected) { client_.emplace(std::move(connected)); });
}

Result<json> LiveClient::ask(const json& request) {
  return client_ ? client_->request(request, kReplyTimeout)
                 : fail(ErrorCode::kUnavailable, "{}: not connected", socket_);
}

Result<json> LiveClient::status() {
  return ask({{"cmd", "status"}}).and_then([this](const json& reply) -> Result<json> {
    const auto status = reply.find("status");
    if (status == reply.end() || !status->is_object()) {
      return fail(ErrorCode::kInvalidData, "{}: the reply has no status", socket_);
    }
    return *status;
  });
}

Result<json> LiveClient::ask_once(const json& request) {
  return connect().and_then([&] { return ask(request); });
}

}  // namespace geoflow::tools
