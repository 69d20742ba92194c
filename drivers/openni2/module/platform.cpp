#include "openni2/module/platform.hpp"

#include <string>
#include <vector>

#include "d435i/core/transport.hpp"
#include "d435i/device/open.hpp"
#include "d435i/usb/usb_transport.hpp"
#include "v4l2/topology.hpp"

namespace geoflow::drivers::openni2 {

std::vector<std::string> connected_cameras() {
  std::vector<std::string> serials;
  for (const v4l2::UsbCamera& camera : v4l2::find_cameras(d435i::kVendor, d435i::kProduct)) {
    serials.push_back(camera.serial);
  }
  return serials;
}

d435i::OpenTransport camera_opener() {
  return &d435i::open_by_either;
}

}  // namespace geoflow::drivers::openni2
