#include "openni2/module/device.hpp"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>

#include <Driver/OniDriverAPI.h>
#include <OniCEnums.h>
#include <OniCProperties.h>
#include <OniCTypes.h>

#include "d435i/core/transport.hpp"
#include "openni2/module/camera_feed.hpp"
#include "openni2/module/modes.hpp"
#include "openni2/module/properties.hpp"
#include "openni2/module/stream.hpp"

namespace geoflow::drivers::openni2 {

using d435i::VideoStream;

Device::Device(std::unique_ptr<CameraFeed> feed)
    : feed_{std::move(feed)},
      sensors_{
          {{VideoStream::kDepth, ONI_SENSOR_DEPTH, oni_modes(feed_->modes(), VideoStream::kDepth)},
           {VideoStream::kColor, ONI_SENSOR_COLOR,
            oni_modes(feed_->modes(), VideoStream::kColor)}}} {
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    Sensor& sensor = sensors_.at(i);
    infos_.at(i) = {.sensorType = sensor.type,
                    .numSupportedVideoModes = static_cast<int>(sensor.modes.size()),
                    .pSupportedVideoModes = sensor.modes.data()};
  }
}

OniStatus Device::getSensorInfoList(OniSensorInfo** infos, int* count) {
  *infos = infos_.data();
  *count = static_cast<int>(infos_.size());
  return ONI_STATUS_OK;
}

oni::driver::StreamBase* Device::createStream(OniSensorType type) {
  const auto sensor = std::ranges::find(sensors_, type, &Sensor::type);
  const auto mode = sensor != sensors_.end() ? default_mode(sensor->modes) : std::nullopt;
  if (!mode) {
    return nullptr;
  }
  streams_.push_back(std::make_unique<Stream>(*feed_, state_, sensor->kind, *mode, sensor->modes));
  return streams_.back().get();
}

void Device::destroyStream(oni::driver::StreamBase* stream) {
  std::erase_if(streams_, [&](const auto& one) { return one.get() == stream; });
}

OniStatus Device::getProperty(int property, void* data, int* size) {
  const auto& versions = feed_->tables().versions;
  switch (property) {
    case ONI_DEVICE_PROPERTY_FIRMWARE_VERSION:
      return give_text(versions.firmware.text(), data, size);
    case ONI_DEVICE_PROPERTY_SERIAL_NUMBER:
      return give_text(versions.serial, data, size);
    case ONI_DEVICE_PROPERTY_DRIVER_VERSION:
      return give(OniVersion{.major = 0, .minor = 1, .maintenance = 0, .build = 0}, data, size);
    case ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION:
      return give(
          state_.registered ? ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR : ONI_IMAGE_REGISTRATION_OFF,
          data, size);
    default:
      return ONI_STATUS_NOT_SUPPORTED;
  }
}

OniStatus Device::setProperty(int property, const void* data, int size) {
  if (property != ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION) {
    return ONI_STATUS_NOT_SUPPORTED;
  }
  const auto mode = take<OniImageRegistrationMode>(data, size);
  if (!mode || isImageRegistrationModeSupported(*mode) == FALSE) {
    return ONI_STATUS_BAD_PARAMETER;
  }
  state_.registered = *mode == ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR;
  return ONI_STATUS_OK;
}

OniBool Device::isPropertySupported(int property) {
  switch (property) {
    case ONI_DEVICE_PROPERTY_FIRMWARE_VERSION:
    case ONI_DEVICE_PROPERTY_SERIAL_NUMBER:
    case ONI_DEVICE_PROPERTY_DRIVER_VERSION:
    case ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION:
      return TRUE;
    default:
      return FALSE;
  }
}

OniBool Device::isImageRegistrationModeSupported(OniImageRegistrationMode mode) {
  return mode == ONI_IMAGE_REGISTRATION_OFF || mode == ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR
             ? TRUE
             : FALSE;
}

}  // namespace geoflow::drivers::openni2
