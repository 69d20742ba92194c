#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include <Driver/OniDriverAPI.h>
#include <OniCTypes.h>

#include "d435i/core/transport.hpp"
#include "openni2/module/camera_feed.hpp"
#include "openni2/module/stream.hpp"

namespace geoflow::drivers::openni2 {

/// A D435i as an OpenNI device with a depth and a colour sensor. OpenNI calls its functions one at
/// a time.
class Device final : public oni::driver::DeviceBase {
 public:
  explicit Device(std::unique_ptr<CameraFeed> feed);

  OniStatus getSensorInfoList(OniSensorInfo** infos, int* count) override;
  /// Null where the camera has no such sensor.
  oni::driver::StreamBase* createStream(OniSensorType type) override;
  void destroyStream(oni::driver::StreamBase* stream) override;
  OniStatus getProperty(int property, void* data, int* size) override;
  OniStatus setProperty(int property, const void* data, int size) override;
  OniBool isPropertySupported(int property) override;
  OniBool isImageRegistrationModeSupported(OniImageRegistrationMode mode) override;

 private:
  struct Sensor {
    d435i::VideoStream kind;
    OniSensorType type;
    std::vector<OniVideoMode> modes;
  };

  std::unique_ptr<CameraFeed> feed_;
  DeviceState state_;
  std::array<Sensor, d435i::kVideoStreams> sensors_;
  std::array<OniSensorInfo, d435i::kVideoStreams> infos_{};  // of sensors_, for OpenNI to read
  std::vector<std::unique_ptr<Stream>> streams_;
};

}  // namespace geoflow::drivers::openni2
