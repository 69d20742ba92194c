#include "process.hpp"

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "geoflow/hal/time.hpp"

namespace geoflow::tests {
namespace {

std::string read_text(const std::filesystem::path& path) {
  const std::ifstream file{path};
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::filesystem::path with_ending(std::filesystem::path path, const char* ending) {
  path += ending;
  return path;
}

}  // namespace

Process::Process(const std::vector<std::string>& arguments, const std::filesystem::path& log)
    : log_{log} {
  std::vector<std::string> copies = arguments;
  std::vector<char*> argv;
  argv.reserve(copies.size());
  for (std::string& argument : copies) {
    argv.push_back(argument.data());
  }
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions{};
  ::posix_spawn_file_actions_init(&actions);
  constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, with_ending(log, ".out").c_str(),
                                     kFlags, 0600);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, with_ending(log, ".err").c_str(),
                                     kFlags, 0600);
  const int failed = ::posix_spawn(&pid_, argv.front(), &actions, nullptr, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    throw std::runtime_error{"cannot start " + arguments.front()};
  }
}

Process::~Process() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
}

void Process::send_signal(int signal) const {
  ::kill(pid_, signal);
}

std::optional<int> Process::wait(Duration timeout) {
  const HostTime deadline = HostClock::now() + timeout;
  int status = 0;
  while (::waitpid(pid_, &status, WNOHANG) == 0) {
    if (HostClock::now() > deadline) {
      return std::nullopt;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  pid_ = -1;
  constexpr int kSignalBase = 128;
  return WIFEXITED(status) ? WEXITSTATUS(status) : kSignalBase + WTERMSIG(status);
}

std::string Process::out() const {
  return read_text(with_ending(log_, ".out"));
}
std::string Process::err() const {
  return read_text(with_ending(log_, ".err"));
}

Finished run_process(const std::vector<std::string>& arguments, const std::filesystem::path& log) {
  Process process{arguments, log};
  const auto code = process.wait(std::chrono::minutes{5});
  return {.code = code.value_or(-1), .out = process.out(), .err = process.err()};
}

}  // namespace geoflow::tests
