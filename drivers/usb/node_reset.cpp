#include "usb/node_reset.hpp"

#include <filesystem>

#include <fcntl.h>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::drivers::usb {

Result<void> reset_node(const std::filesystem::path& node) {
  const UniqueFd fd{::open(node.c_str(), O_WRONLY | O_CLOEXEC)};
  if (!fd || ::ioctl(fd.get(), USBDEVFS_RESET, nullptr) != 0) {
    return fail_errno(node.string());
  }
  return {};
}

}  // namespace geoflow::drivers::usb
