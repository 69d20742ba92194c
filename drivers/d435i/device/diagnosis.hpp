#pragma once

#include <vector>

#include "geoflow/drivers/d435i.hpp"

#include "v4l2/topology.hpp"

namespace geoflow::drivers::d435i {

/// What was seen of one video node.
struct SeenNode {
  v4l2::VideoNode node;
  bool accessible = false;     ///< it may be opened
  bool metadata = false;       ///< else video
  bool full_metadata = false;  ///< it knows 'D4XX'
};

/// What was seen of one camera.
struct SeenCamera {
  v4l2::UsbCamera camera;
  bool usb_accessible = false;  ///< its node of usbfs may be written
  std::vector<SeenNode> nodes{};
  bool iio_writable = true;  ///< its sensors may be set up
};

/// What this machine shows of cameras.
struct Surroundings {
  std::vector<SeenCamera> cameras{};
  bool in_recovery = false;  ///< a camera waits for firmware (8086:0adb)
};

[[nodiscard]] Surroundings look_around();

/// What there is to say about them. Pure.
[[nodiscard]] std::vector<D435iFinding> diagnose(const Surroundings& seen);

}  // namespace geoflow::drivers::d435i
