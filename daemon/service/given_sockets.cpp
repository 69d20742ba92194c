#include "service/given_sockets.hpp"

#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/socket.h>
#include <systemd/sd-daemon.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon::service {
namespace {

constexpr std::string_view kPose = "pose";
constexpr std::string_view kControl = "control";

/// What libsystemd allocates is for its caller to free.
struct Free {
  void operator()(void* memory) const noexcept {
    // NOLINTNEXTLINE(cppcoreguidelines-no-malloc,cppcoreguidelines-owning-memory): malloc's
    std::free(memory);
  }
};
using Names = std::unique_ptr<char*[], Free>;  // NOLINT(modernize-avoid-c-arrays): libsystemd's

/// What was asked for, or an empty text: for messages only.
std::string variable(const char* name) {
  const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): before any thread starts
  return value == nullptr ? "" : value;
}

Result<void> adopt(UniqueFd fd, std::string_view name, GivenSockets& given) {
  if (name != kPose && name != kControl) {
    return fail(ErrorCode::kInvalidArgument,
                "$LISTEN_FDNAMES: '{}' is none of geoflowd's sockets; there are: pose, control",
                name);
  }
  const bool is_pose = name == kPose;
  const int type = is_pose ? SOCK_SEQPACKET : SOCK_STREAM;
  if (::sd_is_socket_unix(fd.get(), type, 1, nullptr, 0) <= 0) {
    return fail(ErrorCode::kInvalidArgument,
                "$LISTEN_FDNAMES: '{}' (descriptor {}) is not a listening Unix socket of type {}",
                name, fd.get(), is_pose ? "SOCK_SEQPACKET" : "SOCK_STREAM");
  }
  UniqueFd& place = is_pose ? given.pose : given.control;
  if (place) {
    return fail(ErrorCode::kInvalidArgument, "$LISTEN_FDNAMES: '{}' stands there twice", name);
  }
  const int flags = ::fcntl(fd.get(), F_GETFL);
  if (flags < 0 || ::fcntl(fd.get(), F_SETFL, flags | O_NONBLOCK) != 0) {
    return fail_errno("fcntl");
  }
  place = std::move(fd);
  return {};
}

}  // namespace

Result<GivenSockets> take_given_sockets() {
  const std::string asked = variable("LISTEN_FDS");
  char** raw_names = nullptr;
  const int count = ::sd_listen_fds_with_names(1, &raw_names);
  const Names names{raw_names};
  if (count < 0) {
    return fail(ErrorCode::kInvalidArgument,
                "$LISTEN_FDS={} (with $LISTEN_PID, $LISTEN_FDNAMES): no sockets can be taken: {}",
                asked, std::generic_category().message(-count));
  }
  GivenSockets given;
  Result<void> all;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const std::unique_ptr<char, Free> name{names[i]};
    UniqueFd fd{SD_LISTEN_FDS_START + static_cast<int>(i)};
    if (all) {
      all = adopt(std::move(fd), name.get(), given);
    }
  }
  return all.map([&] { return std::move(given); });
}

}  // namespace geoflow::daemon::service
