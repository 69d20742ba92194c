#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <thread>

#include "geoflow/hal/unique_fd.hpp"

/// Clients of the pose socket, also of the worst kinds, to measure and test the daemon with.
namespace geoflow::tools {

/// A nonblocking connection to a pose socket on which nothing is said yet; empty where there is
/// none.
[[nodiscard]] UniqueFd connect_to_poses(const std::filesystem::path& path);

struct ClientLoadOptions {
  std::filesystem::path socket;
  // NOLINTBEGIN(readability-magic-numbers): each is named by its member
  int readers = 40;  ///< take every pose, at frames and IMU samples
  int deaf = 16;     ///< say HELLO and never read
  int garblers = 8;  ///< send what is no record, as fast as they can
  // NOLINTEND(readability-magic-numbers)
};

/// All these clients on a thread of their own (`load`) of the lowest priority (nice 19): what they
/// take of the processor is what others leave. Each connects again when it is cut off. They begin
/// when made, as soon as the socket is there, and end with this object.
class ClientLoad {
 public:
  explicit ClientLoad(const ClientLoadOptions& options);
  ClientLoad(const ClientLoad&) = delete;
  ClientLoad& operator=(const ClientLoad&) = delete;
  ~ClientLoad() = default;

  /// Poses that readers have taken; datagrams of garbage that were sent; connections that were
  /// made. Any thread.
  [[nodiscard]] std::uint64_t records() const noexcept { return records_.load(); }
  [[nodiscard]] std::uint64_t garbage() const noexcept { return garbage_.load(); }

 private:
  void run(const ClientLoadOptions& options, const std::stop_token& stop);

  std::atomic<std::uint64_t> records_{0};
  std::atomic<std::uint64_t> garbage_{0};
  std::jthread thread_;
};

}  // namespace geoflow::tools
