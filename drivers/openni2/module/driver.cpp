#include "openni2/module/driver.hpp"

#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include <Driver/OniDriverAPI.h>
#include <OniCEnums.h>
#include <OniCTypes.h>

#include "geoflow/hal/log.hpp"

#include "d435i/usb/usb_transport.hpp"
#include "openni2/module/camera_feed.hpp"
#include "openni2/module/device.hpp"
#include "openni2/module/platform.hpp"
#include "openni2/module/properties.hpp"

namespace geoflow::drivers::openni2 {
namespace {

constexpr std::string_view kScheme = "d435i/";

OniDeviceInfo info_of(const std::string& uri) {
  OniDeviceInfo info{};
  const auto set = [](std::string_view text, char(&target)[ONI_MAX_STR]) {
    int size = ONI_MAX_STR;
    (void)give_text(text, target, &size);
  };
  set(uri, info.uri);
  set("Intel", info.vendor);
  set("RealSense D435i", info.name);
  info.usbVendorId = d435i::kVendor;
  info.usbProductId = d435i::kProduct;
  return info;
}

}  // namespace

OniStatus Driver::initialize(oni::driver::DeviceConnectedCallback connected,
                             oni::driver::DeviceDisconnectedCallback disconnected,
                             oni::driver::DeviceStateChangedCallback changed, void* cookie) {
  const OniStatus status = DriverBase::initialize(connected, disconnected, changed, cookie);
  if (status == ONI_STATUS_OK) {
    list_cameras();
  }
  return status;
}

void Driver::list_cameras() {
  for (const std::string& serial : connected_cameras()) {
    const std::string uri = std::string{kScheme} + serial;
    const auto [entry, is_new] = listed_.try_emplace(uri, info_of(uri));
    if (is_new) {
      deviceConnected(&entry->second);
    }
  }
}

OniStatus Driver::tryDevice(const char* uri) {
  if (uri == nullptr || !std::string_view{uri}.starts_with(kScheme)) {
    return ONI_STATUS_ERROR;
  }
  list_cameras();
  return listed_.contains(uri) ? ONI_STATUS_OK : ONI_STATUS_NO_DEVICE;
}

oni::driver::DeviceBase* Driver::deviceOpen(const char* uri, const char* /*mode*/) {
  if (uri == nullptr || !listed_.contains(uri)) {
    getServices().errorLoggerAppend("no such D435i: %s", uri != nullptr ? uri : "");
    return nullptr;
  }
  auto feed = CameraFeed::open(std::string{uri}.substr(kScheme.size()), camera_opener());
  if (!feed) {
    getServices().errorLoggerAppend("%s", feed.error().message.c_str());
    return nullptr;
  }
  open_.push_back(std::make_unique<Device>(std::move(*feed)));
  return open_.back().get();
}

void Driver::deviceClose(oni::driver::DeviceBase* device) {
  std::erase_if(open_, [&](const auto& one) { return one.get() == device; });
}

void Driver::shutdown() {
  open_.clear();
}

void* Driver::enableFrameSync(oni::driver::StreamBase** /*streams*/, int /*count*/) {
  return this;
}

void Driver::disableFrameSync(void* /*group*/) {}

}  // namespace geoflow::drivers::openni2
