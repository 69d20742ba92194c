#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

/// Which nodes the kernel has made for a USB camera, by sysfs: numbers of nodes say nothing.
namespace geoflow::drivers::v4l2 {

/// One /dev/videoN.
struct VideoNode {
  std::filesystem::path path;  ///< /dev/video4
  int number = 0;              ///< 4
  int interface = 0;           ///< of USB, to which it belongs
};

/// One IIO device.
struct IioNode {
  std::filesystem::path sysfs;  ///< …/iio:device0
  std::filesystem::path path;   ///< /dev/iio:device0
  std::string name;             ///< accel_3d, gyro_3d
};

/// One USB device and its nodes.
struct UsbCamera {
  std::string place;                 ///< bus and ports: "2-1.4"
  std::string serial;                ///< empty: it shows none
  int speed_mbps = 0;                ///< 480, 5000, …; 0: not known
  std::filesystem::path usb_node{};  ///< /dev/bus/usb/002/005
  std::vector<VideoNode> video{};    ///< by number
  std::vector<IioNode> iio{};        ///< by name
};

/// All devices of that vendor and product, in order of their place. What cannot be read is left
/// out. `sysfs` and `dev` are where those are mounted. Thread-safe.
[[nodiscard]] std::vector<UsbCamera> find_cameras(std::uint16_t vendor, std::uint16_t product,
                                                  const std::filesystem::path& sysfs = "/sys",
                                                  const std::filesystem::path& dev = "/dev");

}  // namespace geoflow::drivers::v4l2
