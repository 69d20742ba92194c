#include "server/control_connection.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/types.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/time.hpp"

#include "protocol/control_request.hpp"
#include "server/acceptor.hpp"

namespace geoflow::daemon {
namespace {

using nlohmann::json;

constexpr double kRequestsPerSecond = 50;
constexpr double kRequestBurst = 100;
constexpr std::size_t kLargestOutput = 65536;  // replies that wait for a client that does not read

json error_reply(const std::string& message) {
  return {{"ok", false}, {"error", {{"code", "invalid_argument"}, {"message", message}}}};
}

const json& help() {
  static const json commands = {
      {"help", "this list"},
      {"status", "version, source, counters, times of the stages, clients"},
      {"watch", "poses as they come; rate_hz (0 to 1000, 0 or none: every one), stream (\"pose\")"},
      {"unwatch", "ends watch"}};
  return commands;
}

}  // namespace

ControlConnection::ControlConnection(Connection connection, HostTime now)
    : connection_{std::move(connection)},
      requests_{kRequestsPerSecond, kRequestBurst, now},
      waiting_since_{now} {}

bool ControlConnection::receive(const StatusProvider& status, HostTime now) {
  std::array<char, kLongestRequest> buffer{};
  const ssize_t size = ::recv(fd(), buffer.data(), buffer.size(), MSG_DONTWAIT);
  if (size <= 0) {
    return size < 0 && (errno == EAGAIN || errno == EINTR);
  }
  input_.append(buffer.data(), static_cast<std::size_t>(size));
  const bool obeys = answer_lines(status, now);
  return flush(now) && obeys;
}

bool ControlConnection::answer_lines(const StatusProvider& status, HostTime now) {
  std::size_t begin = 0;
  for (std::size_t end = input_.find('\n'); end != std::string::npos;
       end = input_.find('\n', begin)) {
    if (!requests_.take(now)) {
      say(error_reply("too many requests"), now);
      return false;
    }
    answer(std::string_view{input_}.substr(begin, end - begin), status, now);
    begin = end + 1;
    if (output_.size() > kLargestOutput) {
      return false;
    }
  }
  input_.erase(0, begin);
  if (input_.size() > kLongestRequest) {
    say(error_reply("a request is one line of at most 4096 bytes"), now);
    return false;
  }
  return true;
}

void ControlConnection::answer(std::string_view line, const StatusProvider& status, HostTime now) {
  const auto request = parse_control_request(line);
  say(request ? reply_to(*request, status) : error_reply(request.error().message), now);
}

json ControlConnection::reply_to(const ControlRequest& request, const StatusProvider& status) {
  json reply = {{"ok", true}, {"reply", request.name}};
  if (!request.id.is_null()) {
    reply["id"] = request.id;
  }
  if (const auto* watch = std::get_if<WatchRequest>(&request.command)) {
    watch_ = RateLimit{watch->rate_hz};
  } else if (std::holds_alternative<UnwatchRequest>(request.command)) {
    watch_.reset();
  } else if (std::holds_alternative<StatusRequest>(request.command)) {
    reply["status"] = status();
  } else {
    reply["commands"] = help();
  }
  return reply;
}

void ControlConnection::offer(const geoflow_pose& pose, HostTime now) {
  if (!watch_ || !watch_->due(now)) {
    return;
  }
  if (blocked()) {
    ++dropped_since_last_;
    return;
  }
  say({{"stream", "pose"},
       {"dropped", std::exchange(dropped_since_last_, 0)},
       {"pose", pose_to_json(pose)}},
      now);
}

void ControlConnection::say(const json& line, HostTime now) {
  if (output_.empty()) {
    waiting_since_ = now;
  }
  output_ += line.dump(-1, ' ', false, json::error_handler_t::replace);
  output_ += '\n';
}

bool ControlConnection::flush(HostTime now) {
  while (!output_.empty()) {
    const ssize_t size = ::send(fd(), output_.data(), output_.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (size < 0) {
      return errno == EAGAIN || errno == EINTR;
    }
    output_.erase(0, static_cast<std::size_t>(size));
    waiting_since_ = now;
  }
  return true;
}

}  // namespace geoflow::daemon
