#pragma once

#include <deque>
#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {

/// A client of the control socket (docs/protocol.md): requests with their replies, and the lines of
/// a stream that is watched. Thread-bound.
class ControlClient {
 public:
  /// Connects and reads the daemon's greeting. kUnavailable where no daemon listens, or it has no
  /// room for another client; kInvalidData where what answers is no geoflowd.
  [[nodiscard]] static Result<ControlClient> connect(const std::filesystem::path& socket);

  /// The daemon's first line: `hello`, `version`, `protocol`.
  [[nodiscard]] const nlohmann::json& greeting() const noexcept { return greeting_; }

  /// Sends a request and waits for its reply. Lines of a stream that come before it are kept for
  /// next(). Errors: what the daemon answers, with its code and sentence; kUnavailable where it has
  /// gone, or nothing comes within `timeout`; kInvalidData for what is no JSON.
  [[nodiscard]] Result<nlohmann::json> request(const nlohmann::json& request, Duration timeout);

  /// The next line of the stream that is watched; nothing after `timeout` or a signal. Errors as
  /// above.
  [[nodiscard]] Result<std::optional<nlohmann::json>> next(Duration timeout);

 private:
  explicit ControlClient(UniqueFd fd) : fd_{std::move(fd)} {}
  [[nodiscard]] Result<std::optional<nlohmann::json>> read_line(HostTime deadline);
  [[nodiscard]] Result<void> send(const nlohmann::json& request) const;

  UniqueFd fd_;
  std::string input_;
  nlohmann::json greeting_;
  std::deque<nlohmann::json> stream_;
};

}  // namespace geoflow::daemon
