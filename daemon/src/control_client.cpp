#include "geoflow/daemon/control_client.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/types.h>
#include <tl/expected.hpp>

#include "geoflow/hal/exit_code.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "src/unix_socket.hpp"

namespace geoflow::daemon {
namespace {

using nlohmann::json;

constexpr auto kGreetingTimeout = std::chrono::seconds{5};
constexpr std::size_t kLongestLine = std::size_t{1} << 20U;  // of a daemon's

tl::unexpected<Error> gone() {
  return fail(ErrorCode::kUnavailable, "the daemon has gone");
}

/// The error of a reply that has one. A refusal by permission is the system's.
tl::unexpected<Error> reported(const json& reply) {
  const json error = reply.value("error", json::object());
  const std::string name = error.value("code", "");
  Error made{.code = ErrorCode::kSystem, .message = error.value("message", "no reason is given")};
  for (const ErrorCode code :
       {ErrorCode::kNotFound, ErrorCode::kInvalidData, ErrorCode::kInvalidArgument,
        ErrorCode::kUnsupported, ErrorCode::kUnavailable}) {
    if (name == error_name(code)) {
      made.code = code;
    }
  }
  return tl::unexpected{std::move(made)};
}

bool is_refused(const json& line) {
  const auto ok = line.find("ok");
  return ok != line.end() && *ok == false;
}

}  // namespace

Result<ControlClient> ControlClient::connect(const std::filesystem::path& socket) {
  auto fd = connect_to(socket, SOCK_STREAM);
  if (!fd) {
    return tl::unexpected{std::move(fd.error())};
  }
  ControlClient client{std::move(*fd)};
  auto first = client.read_line(HostClock::now() + kGreetingTimeout);
  if (!first) {
    return tl::unexpected{std::move(first.error()).in(socket.string())};
  }
  const json line = first->value_or(json::object());
  if (is_refused(line)) {
    return reported(line);
  }
  if (line.value("hello", json{}) != "geoflowd") {
    return fail(ErrorCode::kInvalidData, "{}: what answers is no geoflowd", socket.string());
  }
  client.greeting_ = line;
  return client;
}

Result<json> ControlClient::request(const json& request, Duration timeout) {
  auto sent = send(request);
  if (!sent) {
    return tl::unexpected{std::move(sent.error())};
  }
  const HostTime deadline = HostClock::now() + timeout;
  while (true) {
    auto line = read_line(deadline);
    if (!line) {
      return tl::unexpected{std::move(line.error())};
    }
    if (!*line) {
      return fail(ErrorCode::kUnavailable, "the daemon does not answer");
    }
    json& value = **line;
    if (is_refused(value)) {
      return reported(value);
    }
    if (value.contains("ok")) {
      return std::move(value);
    }
    stream_.push_back(std::move(value));
  }
}

Result<std::optional<json>> ControlClient::next(Duration timeout) {
  if (!stream_.empty()) {
    json line = std::move(stream_.front());
    stream_.pop_front();
    return line;
  }
  auto line = read_line(HostClock::now() + timeout);
  if (line && *line && is_refused(**line)) {
    return reported(**line);
  }
  return line;
}

Result<void> ControlClient::send(const json& request) const {
  const std::string line = request.dump(-1, ' ', false, json::error_handler_t::replace) + '\n';
  for (std::string_view left = line; !left.empty();) {
    const ssize_t size = ::send(fd_.get(), left.data(), left.size(), MSG_NOSIGNAL);
    if (size < 0 && errno != EINTR) {
      return errno == EPIPE ? gone() : fail_errno("control socket");
    }
    left.remove_prefix(size < 0 ? 0 : static_cast<std::size_t>(size));
  }
  return {};
}

/// One line; nothing after the deadline or a signal.
Result<std::optional<json>> ControlClient::read_line(HostTime deadline) {
  std::size_t end = input_.find('\n');
  while (end == std::string::npos) {
    const auto readable = wait_readable(fd_.get(), deadline - HostClock::now());
    if (!readable) {
      return tl::unexpected{readable.error()};
    }
    if (!*readable) {
      return std::nullopt;
    }
    std::array<char, 4096> buffer{};
    const ssize_t size = ::recv(fd_.get(), buffer.data(), buffer.size(), 0);
    if (size == 0 || (size < 0 && errno == ECONNRESET)) {
      return gone();
    }
    if (size < 0) {
      return fail_errno("control socket");
    }
    const std::size_t searched = input_.size();
    input_.append(buffer.data(), static_cast<std::size_t>(size));
    end = input_.find('\n', searched);
    if (end == std::string::npos && input_.size() > kLongestLine) {
      return fail(ErrorCode::kInvalidData, "the daemon's line has no end");
    }
  }
  json value = json::parse(std::string_view{input_}.substr(0, end), nullptr, false);
  input_.erase(0, end + 1);
  if (!value.is_object()) {
    return fail(ErrorCode::kInvalidData, "the daemon's line is no JSON object");
  }
  return value;
}

}  // namespace geoflow::daemon
