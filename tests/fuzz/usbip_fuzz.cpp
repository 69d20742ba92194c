#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/d435i.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"
#include "geoflow/tools/emulator/world.hpp"

#include "src/messages.hpp"
#include "src/session.hpp"

// Any bytes as what a host sends to an attached D435i: answered, stalled or refused with a reason,
// in bounded memory, and time goes on meanwhile. The camera looks at a small world with images and
// an IMU.

namespace {

using namespace geoflow;            // NOLINT(google-build-using-namespace): a program of its own
using namespace geoflow::emulator;  // NOLINT(google-build-using-namespace)

constexpr int kWidth = 32;
constexpr int kHeight = 20;

class SmallWorld final : public World {
 public:
  SmallWorld() {
    calibration_.camera = {
        .width = kWidth, .height = kHeight, .fx = 30, .fy = 30, .cx = 16, .cy = 10};
    calibration_.T_cam_imu = SE3{};
  }
  [[nodiscard]] const Calibration& calibration() const override { return calibration_; }
  [[nodiscard]] Result<std::optional<WorldSample>> next() override {
    constexpr std::int64_t kStepNs = 5'000'000;
    constexpr int kKinds = 3;
    const Duration t{kStepNs * count_};
    WorldSample sample{.t = t, .t_sent = t};
    switch (count_++ % kKinds) {
      case 0:
        sample.sample = ImuSample{};
        break;
      case 1:
        sample.sample = ColorFrame{pool_.acquire({kWidth, kHeight, PixelFormat::kBgr8})};
        break;
      default:
        sample.sample = DepthFrame{pool_.acquire({kWidth, kHeight, PixelFormat::kDepth16})};
        break;
    }
    return sample;
  }

 private:
  Calibration calibration_;
  FramePool pool_{64};
  std::int64_t count_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kChunk = 96;
  constexpr Duration kStep{20'000'000};
  constexpr std::size_t kMostOutput = std::size_t{32} << 20U;
  auto camera = D435i::create({}, std::make_unique<SmallWorld>());
  if (!camera) {
    std::abort();
  }
  HostTime now{kStep};
  usbip::Session session{**camera, now};
  auto rest = std::as_bytes(std::span{data, size});
  while (!rest.empty()) {
    const auto chunk = rest.first(std::min(kChunk, rest.size()));
    rest = rest.subspan(chunk.size());
    now += kStep;
    if (const auto fed = session.feed(chunk, now); !fed) {
      if (fed.error().message.empty()) {
        std::abort();
      }
      return 0;
    }
    if (session.output().size() > kMostOutput) {
      std::abort();
    }
    session.sent(session.output().size());
    (void)session.next_due(now);
  }
  return 0;
}
