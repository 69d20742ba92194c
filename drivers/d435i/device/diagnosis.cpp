#include "d435i/device/diagnosis.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "geoflow/drivers/d435i.hpp"

#include "d435i/usb/usb_transport.hpp"
#include "v4l2/topology.hpp"
#include "v4l2/video_device.hpp"

namespace geoflow::drivers {
namespace d435i {
namespace {

using Grade = D435iFinding::Grade;

constexpr std::uint16_t kRecoveryProduct = 0x0adb;
constexpr int kSuperSpeed_mbps = 5000;
constexpr std::size_t kImuSensors = 2;
constexpr const char* kRules =
    "copy udev/60-geoflow.rules to /etc/udev/rules.d, run `udevadm control --reload`, and plug the "
    "camera in again; the user must be in the group plugdev";

SeenNode look_at(const v4l2::VideoNode& node) {
  SeenNode seen{.node = node};
  if (const auto device = v4l2::VideoDevice::open(node.path)) {
    seen.accessible = true;
    seen.metadata = device->is_metadata();
    seen.full_metadata = seen.metadata && device->has_format(v4l2::fourcc('D', '4', 'X', 'X'));
  }
  return seen;
}

class Findings {
 public:
  void good(std::string what) { add(Grade::kGood, std::move(what), {}); }
  void note(std::string what, std::string remedy) {
    add(Grade::kNote, std::move(what), std::move(remedy));
  }
  void problem(std::string what, std::string remedy) {
    add(Grade::kProblem, std::move(what), std::move(remedy));
  }
  [[nodiscard]] std::vector<D435iFinding> take() && { return std::move(all_); }

 private:
  void add(Grade grade, std::string what, std::string remedy) {
    all_.push_back({grade, std::move(what), std::move(remedy)});
  }
  std::vector<D435iFinding> all_;
};

void judge_link(const SeenCamera& seen, Findings& findings) {
  const v4l2::UsbCamera& camera = seen.camera;
  findings.good(fmt::format("a D435i {} is plugged in at {}", camera.serial, camera.place));
  if (camera.speed_mbps >= kSuperSpeed_mbps) {
    findings.good(fmt::format("its link is USB 3 ({} Mb/s)", camera.speed_mbps));
  } else {
    findings.problem(
        fmt::format("its link is USB 2 ({} Mb/s): 640x480 at 30 Hz and less, and not all sizes",
                    camera.speed_mbps),
        "use a USB 3 cable and port, and push the plug in at once and whole: after a slow plug-in "
        "a camera stays on USB 2 until it is plugged in again");
  }
  if (seen.usb_accessible) {
    findings.good("USB may be used: resets, and transport = \"libusb\", work");
  } else {
    findings.problem(
        fmt::format("{} may not be written, so the camera cannot be reset, nor used by "
                    "libusb",
                    camera.usb_node.string()),
        kRules);
  }
}

void judge_video(const SeenCamera& seen, Findings& findings) {
  if (seen.nodes.empty()) {
    findings.problem("the kernel shows no video nodes for it",
                     "run `modprobe uvcvideo`, or set d435i.transport = \"libusb\"");
    return;
  }
  for (const SeenNode& node : seen.nodes) {
    if (!node.accessible) {
      findings.problem(fmt::format("{} may not be opened", node.node.path.string()), kRules);
    }
  }
  const auto metadata = std::ranges::count_if(seen.nodes, &SeenNode::metadata);
  const auto full = std::ranges::count_if(seen.nodes, &SeenNode::full_metadata);
  if (metadata == 0) {
    findings.note("the kernel shows no metadata nodes: frames are stamped by their arrival",
                  "use Linux 4.16 or newer, or d435i.transport = \"libusb\"");
  } else if (full == 0) {
    findings.note(
        "the kernel passes on the standard part of the metadata alone: frames are stamped by the "
        "camera at their end, not in the middle of their exposure",
        "use Linux 6.5 or newer, or before the camera is plugged in run "
        "`echo 8086 0b3a 0e 8086 0b03 > /sys/bus/usb/drivers/uvcvideo/new_id`");
  } else {
    findings.good("the kernel passes on the camera's metadata");
  }
}

void judge_imu(const SeenCamera& seen, Findings& findings) {
  if (seen.camera.iio.size() < kImuSensors) {
    findings.problem("the kernel shows no accelerometer and gyroscope of it",
                     "run `modprobe -a hid-sensor-hub hid-sensor-accel-3d hid-sensor-gyro-3d`, or "
                     "set d435i.transport = \"libusb\"");
  } else if (!seen.iio_writable) {
    findings.problem("its IMU may not be set up: files of /sys/bus/iio may not be written", kRules);
  } else {
    findings.good("the kernel shows its accelerometer and gyroscope");
  }
}

}  // namespace

Surroundings look_around() {
  Surroundings seen;
  for (v4l2::UsbCamera& camera : v4l2::find_cameras(kVendor, kProduct)) {
    SeenCamera one{.camera = std::move(camera)};
    one.usb_accessible = ::access(one.camera.usb_node.c_str(), R_OK | W_OK) == 0;
    for (const v4l2::VideoNode& node : one.camera.video) {
      one.nodes.push_back(look_at(node));
    }
    one.iio_writable = std::ranges::all_of(one.camera.iio, [](const v4l2::IioNode& node) {
      return ::access((node.sysfs / "buffer/enable").c_str(), W_OK) == 0 &&
             ::access(node.path.c_str(), R_OK) == 0;
    });
    seen.cameras.push_back(std::move(one));
  }
  seen.in_recovery = !v4l2::find_cameras(kVendor, kRecoveryProduct).empty();
  return seen;
}

std::vector<D435iFinding> diagnose(const Surroundings& seen) {
  Findings findings;
  if (seen.in_recovery) {
    findings.problem("a RealSense camera is in recovery: it waits for its firmware",
                     "write its firmware anew with the maker's tool (rs-fw-update)");
  }
  if (seen.cameras.empty()) {
    findings.problem("no D435i (8086:0b3a) is on USB",
                     "plug it in; if it is, try another cable and port, and look at `dmesg`");
  }
  for (const SeenCamera& camera : seen.cameras) {
    judge_link(camera, findings);
    judge_video(camera, findings);
    judge_imu(camera, findings);
  }
  return std::move(findings).take();
}

}  // namespace d435i

std::vector<D435iFinding> diagnose_d435i() {
  return d435i::diagnose(d435i::look_around());
}

}  // namespace geoflow::drivers
