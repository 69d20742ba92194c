#include "server/control_connection.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/types.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"
#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "protocol/control_request.hpp"
#include "server/acceptor.hpp"
#include "server/authority.hpp"

namespace geoflow::daemon {
namespace {

using nlohmann::json;

constexpr double kRequestsPerSecond = 50;
constexpr double kRequestBurst = 100;
constexpr std::size_t kLargestOutput = 65536;  // replies that wait for a client that does not read

json error_reply(const char* code, const std::string& message) {
  return {{"ok", false}, {"error", {{"code", code}, {"message", message}}}};
}

json error_reply(const Error& error) {
  return error_reply(error_name(error.code), error.message);
}

json error_reply(const char* message) {
  return error_reply("invalid_argument", message);
}

json with_id(json reply, const json& id) {
  if (!id.is_null()) {
    reply["id"] = id;
  }
  return reply;
}

json good_reply(const std::string& name, const json& id) {
  return with_id({{"ok", true}, {"reply", name}}, id);
}

const json& help() {
  static const json commands = {
      {"help", "this list"},
      {"status", "version, source, counters, times of the stages, clients"},
      {"watch", "poses as they come; rate_hz (0 to 1000, 0 or none: every one), stream (\"pose\")"},
      {"unwatch", "ends watch"},
      {"config", "every key of the configuration with its value"},
      {"map",
       R"(do ("save", "load" with file, "reset"): writes the map to its file now, takes another file's in its place, or begins an empty one)"},
      {"reset", "the estimator begins anew in the map as it is"},
      {"reload", "reads the configuration again; what cannot change at run time is named"}};
  return commands;
}

}  // namespace

ControlConnection::ControlConnection(Connection connection, std::uint64_t number, HostTime now)
    : connection_{std::move(connection)},
      number_{number},
      requests_{kRequestsPerSecond, kRequestBurst, now},
      waiting_since_{now} {}

bool ControlConnection::receive(const ControlHandlers& handlers, const Authority& authority,
                                HostTime now) {
  std::array<char, kLongestRequest> buffer{};
  const ssize_t size = ::recv(fd(), buffer.data(), buffer.size(), MSG_DONTWAIT);
  if (size <= 0) {
    return size < 0 && (errno == EAGAIN || errno == EINTR);
  }
  input_.append(buffer.data(), static_cast<std::size_t>(size));
  const bool obeys = answer_lines({.handlers = handlers, .authority = authority, .now = now});
  return flush(now) && obeys;
}

bool ControlConnection::answer_lines(const Desk& desk) {
  std::size_t begin = 0;
  for (std::size_t end = input_.find('\n'); end != std::string::npos;
       end = input_.find('\n', begin)) {
    if (!requests_.take(desk.now)) {
      say(error_reply("too many requests"), desk.now);
      return false;
    }
    answer(std::string_view{input_}.substr(begin, end - begin), desk);
    begin = end + 1;
    if (output_.size() > kLargestOutput) {
      return false;
    }
  }
  input_.erase(0, begin);
  if (input_.size() > kLongestRequest) {
    say(error_reply("a request is one line of at most 4096 bytes"), desk.now);
    return false;
  }
  return true;
}

void ControlConnection::answer(std::string_view line, const Desk& desk) {
  const auto request = parse_control_request(line);
  if (!request) {
    say(error_reply(request.error()), desk.now);
  } else if (const auto* change = std::get_if<ChangeRequest>(&request->command)) {
    begin(*change, *request, desk);
  } else {
    say(reply_to(*request, desk.handlers), desk.now);
  }
}

void ControlConnection::begin(const ChangeRequest& change, const ControlRequest& request,
                              const Desk& desk) {
  const Asker asker{.client = number_, .name = request.name, .id = request.id};
  if (desk.authority.permits(connection_)) {
    log::info("server", "{} was asked for by process {}, user {}", request.name, connection_.pid,
              connection_.uid);
    desk.handlers.change(change, asker);
    return;
  }
  const std::string refusal = desk.authority.refusal(connection_, request.name);
  log::warning("server", "{}", refusal);
  say(with_id(error_reply("permission_denied", refusal), request.id), desk.now);
}

void ControlConnection::conclude(const Asker& asker, const Result<json>& outcome, HostTime now) {
  json reply =
      outcome ? good_reply(asker.name, asker.id) : with_id(error_reply(outcome.error()), asker.id);
  if (outcome) {
    reply.update(*outcome);
  }
  say(reply, now);
}

json ControlConnection::reply_to(const ControlRequest& request, const ControlHandlers& handlers) {
  json reply = good_reply(request.name, request.id);
  if (const auto* watch = std::get_if<WatchRequest>(&request.command)) {
    watch_ = RateLimit{watch->rate_hz};
  } else if (std::holds_alternative<UnwatchRequest>(request.command)) {
    watch_.reset();
  } else if (std::holds_alternative<StatusRequest>(request.command)) {
    reply["status"] = handlers.status();
  } else if (std::holds_alternative<ConfigRequest>(request.command)) {
    reply["config"] = handlers.config();
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
