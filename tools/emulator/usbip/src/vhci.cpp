#include "src/vhci.hpp"

#include <array>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <string_view>

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/socket.h>
#include <tl/expected.hpp>
#include <unistd.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator::usbip {
namespace {

constexpr const char* kStatus = "/sys/devices/platform/vhci_hcd.0/status";
constexpr const char* kAttach = "/sys/devices/platform/vhci_hcd.0/attach";
/// Bus and device number on the far side, which the kernel only prints.
constexpr int kDeviceId = 0x10002;

}  // namespace

Result<int> free_port(std::string_view status, UsbSpeed speed) {
  constexpr int kFree = 4;
  const std::string_view wanted = speed == UsbSpeed::kSuper ? "ss" : "hs";
  std::istringstream lines{std::string{status}};
  std::string line;
  while (std::getline(lines, line)) {
    std::istringstream words{line};
    std::string hub;
    int port = 0;
    int state = 0;
    if (words >> hub >> port >> state && hub == wanted && state == kFree) {
      return port;
    }
  }
  return fail(ErrorCode::kUnavailable, "{}: no free port of kind '{}'", kStatus, wanted);
}

Result<UniqueFd> attach_to_kernel(UsbSpeed speed) {
  std::ifstream file{kStatus};
  if (!file) {
    return fail(ErrorCode::kNotFound,
                "{}: this kernel has no virtual host controller; load it: modprobe vhci-hcd",
                kStatus);
  }
  const std::string status{std::istreambuf_iterator<char>{file}, {}};
  const auto port = free_port(status, speed);
  if (!port) {
    return tl::unexpected{port.error()};
  }
  std::array<int, 2> pair{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair.data()) != 0) {
    return fail_errno("socketpair");
  }
  UniqueFd ours{pair[0]};
  const UniqueFd theirs{pair[1]};
  const UniqueFd attach{open(kAttach, O_WRONLY | O_CLOEXEC)};
  if (!attach) {
    return fail_errno(kAttach);
  }
  const std::string request =
      fmt::format("{} {} {} {}", *port, theirs.get(), kDeviceId, static_cast<int>(speed));
  if (write(attach.get(), request.data(), request.size()) < 0) {
    return fail_errno(kAttach);
  }
  return ours;
}

}  // namespace geoflow::emulator::usbip
