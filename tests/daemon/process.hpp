#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "geoflow/hal/time.hpp"

namespace geoflow::tests {

/// A child process whose output goes to files; killed at the end of scope if it still runs.
class Process {
 public:
  /// Starts `arguments.front()`; output to `log` with the endings .out and .err.
  Process(const std::vector<std::string>& arguments, const std::filesystem::path& log);
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process();

  /// While it runs, and until wait() has returned its code.
  [[nodiscard]] pid_t pid() const { return pid_; }
  void send_signal(int signal) const;
  /// Its exit code (128 + n after signal n), or nothing after `timeout`.
  std::optional<int> wait(Duration timeout);
  [[nodiscard]] std::string out() const;
  [[nodiscard]] std::string err() const;

 private:
  std::filesystem::path log_;
  pid_t pid_ = -1;
};

/// Runs a program to its end.
struct Finished {
  int code = -1;
  std::string out;
  std::string err;
};
Finished run_process(const std::vector<std::string>& arguments, const std::filesystem::path& log);

}  // namespace geoflow::tests
