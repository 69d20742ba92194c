#pragma once

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "geoflow/hal/time.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::tests {

/// A service manager's end of $NOTIFY_SOCKET: gets what a service says.
class NotifySocket {
 public:
  explicit NotifySocket(std::filesystem::path path);

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Takes messages until one of them has `text` in it; false after `timeout`.
  bool wait_for(const std::string& text, Duration timeout = std::chrono::minutes{2});
  /// Takes messages for that long, or until one has `text` in it; true if none had.
  bool is_silent_of(const std::string& text, Duration duration);
  /// All messages so far, oldest first.
  [[nodiscard]] const std::vector<std::string>& messages() const { return messages_; }

 private:
  std::filesystem::path path_;
  UniqueFd fd_;
  std::vector<std::string> messages_;
};

}  // namespace geoflow::tests
