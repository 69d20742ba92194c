#include "record/emulated_camera.hpp"

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/daemon/started_ports.hpp"
#include "geoflow/drivers/d435i.hpp"
#include "geoflow/drivers/live_camera.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/recorded_world.hpp"

#include "d435i/device/device.hpp"
#include "d435i/usb/usb_transport.hpp"
#include "model_port.hpp"
#include "scripted_world.hpp"

namespace geoflow::tools::tests {
namespace {

constexpr Duration kImuInterval = std::chrono::milliseconds{5};

/// The recording with an IMU that hangs in the frame of the colour camera, y downwards.
std::unique_ptr<emulator::World> with_imu_at_rest(emulator::World& recorded) {
  auto world = std::make_unique<emulator::ScriptedWorld>();
  world->edit_calibration() = recorded.calibration();
  world->edit_calibration().T_cam_imu = SE3{};
  Duration t_imu{};
  for (auto sample = recorded.next(); sample && *sample; sample = recorded.next()) {
    for (; t_imu <= (*sample)->t_sent; t_imu += kImuInterval) {
      world->add_imu({.accel_mps2 = {0, -9.80665, 0}}, t_imu);
    }
    world->add(std::move(**sample));
  }
  return world;
}

template <typename Sink>
class Fork : public Source<Sink>, public Sink {
 public:
  Fork(Source<Sink>& inner, daemon::SampleReceiver& second) : inner_{inner}, second_{second} {}

  [[nodiscard]] Result<void> start(Sink& sink) override {
    first_ = &sink;
    return inner_.start(*this);
  }
  void stop() override { inner_.stop(); }
  [[nodiscard]] SourceHealth health() const override { return inner_.health(); }
  [[nodiscard]] StampInfo stamps() const override { return inner_.stamps(); }

 protected:
  [[nodiscard]] Sink& first() const { return *first_; }
  [[nodiscard]] daemon::SampleReceiver& second() const { return second_; }

 private:
  Source<Sink>& inner_;
  daemon::SampleReceiver& second_;
  Sink* first_ = nullptr;
};

}  // namespace

class ForkedCamera::CameraFork final : public Fork<CameraSink> {
 public:
  using Fork::Fork;
  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    first().on_color(frame);
    second().on_color(frame);
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    first().on_depth(frame);
    second().on_depth(frame);
  }
};

class ForkedCamera::ImuFork final : public Fork<ImuSink> {
 public:
  using Fork::Fork;
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override {
    first().on_imu(sample);
    second().on_imu(sample);
  }
};

ForkedCamera::ForkedCamera(std::unique_ptr<drivers::LiveCamera> camera,
                           daemon::SampleReceiver& second)
    : inner_{std::move(camera)},
      camera_{std::make_shared<CameraFork>(inner_->camera(), second)},
      imu_{std::make_shared<ImuFork>(*inner_->imu(), second)} {}

const Calibration& ForkedCamera::calibration() const {
  return inner_->calibration();
}
DepthCamera& ForkedCamera::camera() {
  return *camera_;
}
Imu* ForkedCamera::imu() {
  return imu_.get();
}
void ForkedCamera::run(const std::stop_token& stop) {
  inner_->run(stop);
}
std::uint64_t ForkedCamera::turns() const {
  return inner_->turns();
}

Result<std::unique_ptr<drivers::LiveCamera>> open_emulated_camera(
    const std::filesystem::path& recording) {
  namespace d435i = drivers::d435i;
  const auto recorded = emulator::open_recorded_world({.path = recording});
  if (!recorded) {
    return tl::unexpected{recorded.error()};
  }
  auto model = std::make_shared<d435i::tests::PluggedModel>();
  model->now = HostClock::now();
  auto device = emulator::D435i::create({}, with_imu_at_rest(**recorded));
  if (!device) {
    return tl::unexpected{std::move(device.error())};
  }
  model->device = std::move(*device);
  return d435i::open_device(
             {.color_as_gray = true},
             [model](const std::string& /*serial*/) {
               return d435i::open_usb_transport(std::make_unique<d435i::tests::ModelPort>(model));
             })
      .map([](auto camera) -> std::unique_ptr<drivers::LiveCamera> { return camera; });
}

}  // namespace geoflow::tools::tests
