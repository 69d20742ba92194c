#include "geoflow/tools/bench/processes.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <spawn.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

// glibc 2.36 declares it without language linkage.
extern "C" {
#include <sys/pidfd.h>
}

namespace geoflow::tools {
namespace {

constexpr ::mode_t kLogMode = 0644;

/// One running process. It is readable once it has ended.
struct Child {
  std::size_t index = 0;
  pid_t id = 0;
  UniqueFd readable{};
};

Ended wait_for(pid_t id) {
  int status = 0;
  while (::waitpid(id, &status, 0) < 0) {
    if (errno != EINTR) {
      return {};
    }
  }
  return WIFEXITED(status) ? Ended{.exit_code = WEXITSTATUS(status), .signal = 0}
                           : Ended{.exit_code = -1, .signal = WTERMSIG(status)};
}

Result<Child> start(const Command& command, std::size_t index) {
  std::vector<std::string> words = command.arguments;
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) {
    argv.push_back(word.data());
  }
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (command.log.empty()) {
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  } else {
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, command.log.c_str(),
                                     O_WRONLY | O_CREAT | O_TRUNC, kLogMode);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  }
  Child child{.index = index};
  const int status =
      ::posix_spawn(&child.id, argv.front(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (status != 0) {
    return fail(ErrorCode::kSystem, "{}: {}", command.arguments.front(),
                std::generic_category().message(status));
  }
  child.readable = UniqueFd{::pidfd_open(child.id, 0)};
  if (!child.readable) {
    auto failed = fail_errno("watching a process");
    ::kill(child.id, SIGTERM);
    wait_for(child.id);
    return failed;
  }
  return child;
}

/// The processes that run now.
class Running {
 public:
  Running() = default;
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  ~Running() {
    terminate();
    for (const Child& child : children_) {
      wait_for(child.id);
    }
  }

  [[nodiscard]] std::size_t count() const noexcept { return children_.size(); }
  void add(Child child) { children_.push_back(std::move(child)); }

  void terminate() const {
    for (const Child& child : children_) {
      ::kill(child.id, SIGTERM);
    }
  }

  /// Waits until one has ended or a signal came; takes those that have ended out.
  void wait(std::vector<Ended>& ended) {
    std::vector<pollfd> waiting;
    waiting.reserve(children_.size());
    for (const Child& child : children_) {
      waiting.push_back({.fd = child.readable.get(), .events = POLLIN, .revents = 0});
    }
    ::poll(waiting.data(), waiting.size(), -1);
    for (std::size_t i = waiting.size(); i-- > 0;) {
      if (waiting[i].revents != 0) {
        ended[children_[i].index] = wait_for(children_[i].id);
        children_.erase(children_.begin() + static_cast<std::ptrdiff_t>(i));
      }
    }
  }

 private:
  std::vector<Child> children_;
};

}  // namespace

std::string Ended::how() const {
  return signal != 0 ? fmt::format("signal {}", signal) : fmt::format("exit code {}", exit_code);
}

Result<std::vector<Ended>> run_processes(std::span<const Command> commands, std::size_t at_a_time,
                                         const GoOn& go_on) {
  std::vector<Ended> ended(commands.size());
  Running running;
  std::size_t next = 0;
  bool stopped = false;
  while (running.count() > 0 || (next < commands.size() && !stopped)) {
    while (!stopped && next < commands.size() &&
           running.count() < std::max<std::size_t>(at_a_time, 1)) {
      auto child = start(commands[next], next);
      if (!child) {
        return tl::unexpected{std::move(child.error())};
      }
      running.add(*std::move(child));
      ++next;
    }
    running.wait(ended);
    if (!go_on(next - running.count()) && !stopped) {
      stopped = true;
      running.terminate();
    }
  }
  return ended;
}

std::string shell_line(const std::vector<std::string>& arguments) {
  constexpr std::string_view kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,@%";
  std::string line;
  for (const std::string& argument : arguments) {
    line += line.empty() ? "" : " ";
    if (!argument.empty() && argument.find_first_not_of(kPlain) == std::string::npos) {
      line += argument;
      continue;
    }
    line += '\'';
    for (const char c : argument) {
      line += c == '\'' ? std::string{"'\\''"} : std::string{c};
    }
    line += '\'';
  }
  return line;
}

Result<std::filesystem::path> own_program() {
  std::error_code status;
  auto program = std::filesystem::read_symlink("/proc/self/exe", status);
  if (status) {
    return fail(ErrorCode::kSystem, "/proc/self/exe: {}", status.message());
  }
  return program;
}

}  // namespace geoflow::tools
