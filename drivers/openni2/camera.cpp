#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <OniEnums.h>
#include <OpenNI.h>
#include <tl/expected.hpp>

#include "geoflow/drivers/live_camera.hpp"
#include "geoflow/drivers/openni2_camera.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/log.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "openni2/open_device.hpp"
#include "openni2/pixels.hpp"
#include "port.hpp"
#include "replay/oni/structure.hpp"

namespace geoflow::drivers {
namespace {

using openni2::Library;
using openni2::OpenDevice;

constexpr std::string_view kCategory = "openni2";

constexpr Duration kPatience = std::chrono::seconds{3};
constexpr Duration kLookInterval = std::chrono::seconds{2};
// What the pipeline's queues may hold of both kinds, and what the estimator keeps.
constexpr std::size_t kPooledFrames = 48;

class OpenNi2Camera final : public LiveCamera {
 public:
  OpenNi2Camera(OpenNi2Options options, std::unique_ptr<Library> library,
                std::unique_ptr<OpenDevice> device)
      : options_{std::move(options)},
        library_{std::move(library)},
        device_{std::move(device)},
        is_file_{device_->is_file()},
        calibration_{device_->calibration()} {}

  [[nodiscard]] const Calibration& calibration() const override { return calibration_; }
  [[nodiscard]] DepthCamera& camera() override { return camera_; }
  [[nodiscard]] Imu* imu() override { return nullptr; }

  void run(const std::stop_token& stop) override {
    bool started = false;
    bool over = false;
    while (!stop.stop_requested() && !over) {
      started = started ? step() : look_for_device(stop);
      over = is_file_ && (!started || device_->at_end());
      turns_.fetch_add(1, std::memory_order_relaxed);
    }
    device_.reset();
  }

  [[nodiscard]] std::uint64_t turns() const override {
    return turns_.load(std::memory_order_relaxed);
  }

 private:
  /// Opens and starts the device, or says why not and waits before the next look.
  bool look_for_device(const std::stop_token& stop) {
    Result<void> started;
    if (!device_) {
      auto opened = OpenDevice::open(options_);
      if (opened) {
        device_ = std::move(*opened);
      } else {
        started = tl::unexpected{std::move(opened.error())};
      }
    }
    if (device_) {
      started = device_->start();
    }
    newest_ = HostClock::now();
    if (!started) {
      lose(started.error().message);
      std::unique_lock lock{waiting_};
      wake_.wait_for(lock, stop, kLookInterval, [] { return false; });
    }
    return started.has_value();
  }

  /// Delivers a frame, if one comes; false when the device is lost.
  bool step() {
    const auto frame = device_->next();
    const HostTime now = HostClock::now();
    if (!frame) {
      lose(frame.error().message);
      return false;
    }
    if (const auto& arrived = *frame) {
      newest_ = now;
      deliver(*arrived, now);
      return true;
    }
    if (now - newest_ > kPatience) {
      lose("nothing comes from it");
      return false;
    }
    return true;
  }

  void lose(const std::string& why) {
    log::warning(kCategory, "{}", why);
    camera_.set_degraded(why);
    device_.reset();
  }

  void deliver(const openni::VideoFrameRef& frame, HostTime now) {
    const bool depth = frame.getSensorType() == openni::SENSOR_DEPTH;
    const ImageShape shape{.width = calibration_.camera.width,
                           .height = calibration_.camera.height,
                           .format = depth                    ? PixelFormat::kDepth16
                                     : options_.color_as_gray ? PixelFormat::kGray8
                                                              : PixelFormat::kBgr8};
    FrameRef image = pool_.acquire(shape);
    if (!image) {
      camera_.count_dropped();
      return;
    }
    const auto pixel = openni2::source_pixel(frame.getVideoMode().getPixelFormat());
    const auto converted =
        pixel ? openni2::convert({.pixel = *pixel,
                                  .width = frame.getWidth(),
                                  .height = frame.getHeight(),
                                  .step_bytes = static_cast<std::size_t>(frame.getStrideInBytes()),
                                  .bytes = {static_cast<const std::byte*>(frame.getData()),
                                            static_cast<std::size_t>(frame.getDataSize())}},
                                 shape, image.writable_bytes())
              : fail(ErrorCode::kUnsupported, "pixels of kind {}",
                     static_cast<int>(frame.getVideoMode().getPixelFormat()));
    if (!converted) {
      camera_.count_rejected(converted.error().message);
      return;
    }
    const DeviceTime<CameraClock> t_device{std::chrono::microseconds{frame.getTimestamp()}};
    camera_.deliver([&](CameraSink& sink) {
      if (depth) {
        sink.on_depth({.t_device = t_device, .t_arrival = now, .sample = {.image = image}});
      } else {
        sink.on_color({.t_device = t_device, .t_arrival = now, .sample = {.image = image}});
      }
    });
  }

  const OpenNi2Options options_;
  std::unique_ptr<Library> library_;  // outlives the device
  std::unique_ptr<OpenDevice> device_;
  const bool is_file_;
  const Calibration calibration_;
  FramePool pool_{kPooledFrames};
  Port<CameraSink> camera_{{.domain = StampDomain::kDevice}};
  std::atomic<std::uint64_t> turns_{0};
  HostTime newest_{};  // arrival of the newest frame
  std::mutex waiting_;
  std::condition_variable_any wake_;  // never notified: only a stop ends its waits
};

}  // namespace

Result<std::unique_ptr<LiveCamera>> open_openni2_camera(const OpenNi2Options& options) {
  std::error_code error;
  if (std::filesystem::is_regular_file(options.uri, error)) {
    // OpenNI's own player trusts what a file says of itself.
    if (auto whole = oni::check_structure(options.uri); !whole) {
      return tl::unexpected{std::move(whole.error())};
    }
  }
  auto library = std::make_unique<Library>();
  if (auto begun = library->status(); !begun) {
    return tl::unexpected{std::move(begun.error())};
  }
  auto device = OpenDevice::open(options);
  if (!device) {
    return tl::unexpected{std::move(device.error())};
  }
  return std::make_unique<OpenNi2Camera>(options, std::move(library), std::move(*device));
}

}  // namespace geoflow::drivers
