#include "d435i/device/open.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/drivers/d435i.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/result.hpp"

#include "d435i/core/transport.hpp"
#include "d435i/device/device.hpp"
#include "d435i/usb/usb_transport.hpp"
#include "d435i/v4l2/v4l2_transport.hpp"
#include "usb/libusb_port.hpp"
#include "v4l2/topology.hpp"

namespace geoflow::drivers {
namespace {

using d435i::Transport;

Error not_connected(const std::string& serial) {
  return {.code = ErrorCode::kNotFound,
          .message = fmt::format("no D435i{}{} is connected",
                                 serial.empty() ? "" : " with the serial number ", serial)};
}

Result<std::unique_ptr<Transport>> open_by_kernel(const std::string& serial) {
  for (const v4l2::UsbCamera& camera : v4l2::find_cameras(d435i::kVendor, d435i::kProduct)) {
    if (serial.empty() || camera.serial == serial) {
      return d435i::open_v4l2_transport(camera);
    }
  }
  return tl::unexpected{not_connected(serial)};
}

Result<std::unique_ptr<Transport>> open_by_usb(const std::string& serial) {
  return usb::open_device(d435i::kVendor, d435i::kProduct, serial)
      .map_error([&](Error error) {
        return error.code == ErrorCode::kNotFound ? not_connected(serial) : std::move(error);
      })
      .and_then([](std::unique_ptr<usb::Port> port) {
        return d435i::open_usb_transport(std::move(port));
      });
}

}  // namespace

Result<std::unique_ptr<Transport>> d435i::open_by_either(const std::string& serial) {
  constexpr std::size_t kImuSensors = 2;
  const auto cameras = v4l2::find_cameras(d435i::kVendor, d435i::kProduct);
  const auto camera = std::ranges::find_if(
      cameras, [&](const v4l2::UsbCamera& one) { return serial.empty() || one.serial == serial; });
  if (camera != cameras.end() && camera->iio.size() >= kImuSensors) {
    auto opened = d435i::open_v4l2_transport(*camera);
    if (opened) {
      return opened;
    }
    log::debug("d435i", "not by the kernel's drivers: {}", opened.error().message);
  }
  return open_by_usb(serial);
}

Result<std::unique_ptr<D435i>> D435i::open(const D435iOptions& options) {
  switch (options.transport) {
    case D435iTransport::kV4l2:
      return d435i::open_device(options, &open_by_kernel);
    case D435iTransport::kLibusb:
      return d435i::open_device(options, &open_by_usb);
    case D435iTransport::kAuto:
      break;
  }
  return d435i::open_device(options, &d435i::open_by_either);
}

}  // namespace geoflow::drivers
