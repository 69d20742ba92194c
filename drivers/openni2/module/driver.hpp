#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <Driver/OniDriverAPI.h>
#include <OniCTypes.h>

#include "openni2/module/device.hpp"

namespace geoflow::drivers::openni2 {

/// The module's driver: lists the D435i cameras that are plugged in, by the URI `d435i/SERIAL`.
/// OpenNI calls its functions one at a time.
class Driver final : public oni::driver::DriverBase {
 public:
  explicit Driver(OniDriverServices* services) : DriverBase{services} {}

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback changed, void* cookie) override;
  /// Whether the URI is a camera that was plugged in since; it is then listed.
  OniStatus tryDevice(const char* uri) override;
  /// Null where it cannot be opened; why, OpenNI's error text says.
  oni::driver::DeviceBase* deviceOpen(const char* uri, const char* mode) override;
  void deviceClose(oni::driver::DeviceBase* device) override;
  void shutdown() override;

  /// Any set of streams may be paired by their frames' numbers (Stream): there is nothing to do.
  void* enableFrameSync(oni::driver::StreamBase** streams, int count) override;
  void disableFrameSync(void* group) override;

 private:
  void list_cameras();

  std::map<std::string, OniDeviceInfo> listed_;  ///< by URI
  std::vector<std::unique_ptr<Device>> open_;
};

}  // namespace geoflow::drivers::openni2
