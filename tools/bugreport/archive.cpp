#include "bugreport/archive.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <spawn.h>
#include <stdlib.h>  // NOLINT(modernize-deprecated-headers): mkdtemp is POSIX
#include <sys/types.h>
#include <sys/wait.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::tools {
namespace {

/// Starts a program with its output going to `out`; its process, or 0 with errno set.
pid_t start(const std::vector<std::string>& command, int out) {
  std::vector<std::string> words = command;
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) {
    argv.push_back(word.data());
  }
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions{};
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t process = 0;
  const int failed =
      ::posix_spawnp(&process, argv.front(), &actions, nullptr, argv.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  errno = failed;
  return failed == 0 ? process : 0;
}

std::string read_end(int fd, std::size_t most_bytes) {
  std::string text;
  std::array<char, 65536> buffer{};
  while (true) {
    const ssize_t size = ::read(fd, buffer.data(), buffer.size());
    if (size == 0 || (size < 0 && errno != EINTR)) {
      return text;
    }
    text.append(buffer.data(), size < 0 ? 0 : static_cast<std::size_t>(size));
    if (text.size() > most_bytes) {
      text.erase(0, text.size() - most_bytes);
    }
  }
}

}  // namespace

Result<std::string> output_of(const std::vector<std::string>& command, std::size_t most_bytes) {
  std::array<int, 2> ends{-1, -1};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    return fail_errno("pipe");
  }
  const UniqueFd reading{ends[0]};
  UniqueFd writing{ends[1]};
  const pid_t process = start(command, writing.get());
  if (process == 0) {
    return fail_errno(command.front());
  }
  writing.reset();
  std::string text = read_end(reading.get(), most_bytes);
  int status = 0;
  while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    return fail(ErrorCode::kSystem, "{} ended with code {}", command.front(),
                WIFEXITED(status) ? WEXITSTATUS(status) : -1);
  }
  return text;
}

Staging::Staging(std::filesystem::path root, std::string name)
    : root_{std::move(root)}, name_{std::move(name)} {}

Staging::Staging(Staging&& other) noexcept
    : root_{std::exchange(other.root_, {})}, name_{std::move(other.name_)} {}

Staging::~Staging() {
  if (!root_.empty()) {
    std::error_code ignored;
    std::filesystem::remove_all(root_, ignored);
  }
}

Result<Staging> Staging::create(const std::string& name) {
  std::error_code failure;
  std::string pattern =
      (std::filesystem::temp_directory_path(failure) / "geoflow-bugreport-XXXXXX").string();
  if (failure || ::mkdtemp(pattern.data()) == nullptr) {
    return fail_errno(pattern);
  }
  Staging staging{pattern, name};
  std::filesystem::create_directory(staging.root_ / name, failure);
  if (failure) {
    return fail(ErrorCode::kSystem, "{}: {}", pattern, failure.message());
  }
  return staging;
}

Result<void> Staging::add(const std::string& name, const std::string& text) const {
  const std::filesystem::path file = root_ / name_ / name;
  std::ofstream stream{file, std::ios::binary};
  stream << text;
  stream.close();
  return stream ? Result<void>{} : fail(ErrorCode::kSystem, "{}: cannot be written", file.string());
}

Result<void> Staging::attach(const std::filesystem::path& path) const {
  const std::filesystem::path folder = root_ / name_ / "attached";
  std::error_code failure;
  if (!std::filesystem::exists(path, failure)) {
    return fail(ErrorCode::kNotFound, "{}: no such file or folder", path.string());
  }
  std::filesystem::create_directories(folder, failure);
  if (!failure) {
    const std::filesystem::path absolute = std::filesystem::absolute(path).lexically_normal();
    const std::filesystem::path last =
        absolute.has_filename() ? absolute.filename() : absolute.parent_path().filename();
    std::filesystem::copy(path, folder / last, std::filesystem::copy_options::recursive, failure);
  }
  return failure ? fail(ErrorCode::kSystem, "{}: {}", path.string(), failure.message())
                 : Result<void>{};
}

Result<void> Staging::pack(const std::filesystem::path& file) const {
  std::filesystem::path unfinished = file;
  unfinished += ".tmp";
  const auto packed = output_of(
      {"tar", "-C", root_.string(), "-czf", std::filesystem::absolute(unfinished).string(), name_},
      0);
  std::error_code failure;
  if (!packed) {
    std::filesystem::remove(unfinished, failure);
    return fail(ErrorCode::kSystem, "{}: {}", file.string(), packed.error().message);
  }
  std::filesystem::rename(unfinished, file, failure);
  return failure ? fail(ErrorCode::kSystem, "{}: {}", file.string(), failure.message())
                 : Result<void>{};
}

}  // namespace geoflow::tools
