#include "replay/faults/stage.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/decode.hpp"
#include "replay/faults/script.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::faults {
namespace {

using ImageArrival = Arrival<CameraClock, EncodedImage>;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// The part that all random faults share: which events they touch.
class RandomStage : public Stage {
 public:
  RandomStage(const Fault& fault, const StageContext& context)
      : fault_{fault}, context_{context}, random_{context.seed} {}

  void apply(Event event, std::vector<Event>& out) final {
    const StreamId stream = stream_of(event);
    if (!fault_.touches(stream)) {
      out.push_back(std::move(event));
      return;
    }
    const Duration since_start = arrival_of(event) - context_.start;
    const bool inside = since_start >= fault_.from && since_start < fault_.until;
    // The draw is made for every event of the stream, so that a window does not shift the later
    // ones.
    const bool drawn = uniform() < fault_.probability;
    if (inside && drawn) {
      strike(std::move(event), stream, out);
    } else {
      pass(std::move(event), stream, out);
    }
  }

 protected:
  /// An event that the fault touches, and one that it does not.
  virtual void strike(Event event, StreamId stream, std::vector<Event>& out) = 0;
  virtual void pass(Event event, StreamId /*stream*/, std::vector<Event>& out) {
    out.push_back(std::move(event));
  }

  void count(StreamId stream) const { ++context_.counters->of(fault_.kind, stream); }
  [[nodiscard]] const Fault& fault() const { return fault_; }

  /// In [0, 1); the same on every platform.
  double uniform() {
    constexpr unsigned kMantissaBits = 53;
    return std::ldexp(static_cast<double>(random_() >> (64U - kMantissaBits)),
                      -static_cast<int>(kMantissaBits));
  }

 private:
  Fault fault_;
  StageContext context_;
  std::mt19937_64 random_;
};

/// kDrop and kGap.
class DropStage final : public RandomStage {
 public:
  using RandomStage::RandomStage;

 protected:
  void strike(Event /*event*/, StreamId stream, std::vector<Event>& /*out*/) override {
    count(stream);
  }
};

class DelayStage final : public RandomStage {
 public:
  using RandomStage::RandomStage;

 protected:
  void strike(Event event, StreamId stream, std::vector<Event>& out) override {
    const Duration delay = fault().delay + from_seconds(uniform() * to_seconds(fault().jitter));
    std::visit([delay](auto& sample) { sample.t_arrival += delay; }, event);
    count(stream);
    out.push_back(std::move(event));
  }
};

class DuplicateStage final : public RandomStage {
 public:
  using RandomStage::RandomStage;

 protected:
  void strike(Event event, StreamId stream, std::vector<Event>& out) override {
    out.push_back(event);
    out.push_back(std::move(event));
    count(stream);
  }
};

/// Holds the event back until the next one of its stream has passed.
class ReorderStage final : public RandomStage {
 public:
  using RandomStage::RandomStage;

  void finish(std::vector<Event>& out) override {
    for (auto& held : held_) {
      if (std::optional<Event> last = std::exchange(held, std::nullopt)) {
        out.push_back(*std::move(last));
      }
    }
  }

 protected:
  void strike(Event event, StreamId stream, std::vector<Event>& out) override {
    auto& held = held_[static_cast<std::size_t>(stream)];
    if (held) {
      pass(std::move(event), stream, out);
    } else {
      held = std::move(event);
    }
  }

  void pass(Event event, StreamId stream, std::vector<Event>& out) override {
    auto held = std::exchange(held_[static_cast<std::size_t>(stream)], std::nullopt);
    const HostTime t = arrival_of(event);
    out.push_back(std::move(event));
    if (held) {
      std::visit([t](auto& sample) { sample.t_arrival = t; }, *held);
      count(stream);
      out.push_back(*std::move(held));
    }
  }

 private:
  std::array<std::optional<Event>, kStreamCount> held_;
};

class StuckStage final : public RandomStage {
 public:
  using RandomStage::RandomStage;

 protected:
  void strike(Event event, StreamId stream, std::vector<Event>& out) override {
    const auto& good = good_[static_cast<std::size_t>(stream)];
    if (!good) {
      pass(std::move(event), stream, out);
      return;
    }
    std::visit(
        [&good](auto& sample) {
          if (const auto* last = std::get_if<std::decay_t<decltype(sample)>>(&*good)) {
            sample.sample = last->sample;
          }
        },
        event);
    count(stream);
    out.push_back(std::move(event));
  }

  void pass(Event event, StreamId stream, std::vector<Event>& out) override {
    good_[static_cast<std::size_t>(stream)] = event;
    out.push_back(std::move(event));
  }

 private:
  std::array<std::optional<Event>, kStreamCount> good_;
};

void poison(ImuSample& sample) {
  sample.accel_mps2.setConstant(kNan);
  sample.gyro_radps.setConstant(kNan);
}
void poison(LegSample& sample) {
  for (JointState& joint : sample.joints) {
    joint = {.q_rad = kNan, .dq_radps = kNan, .tau_nm = kNan};
  }
  sample.foot_force.fill(std::numeric_limits<float>::quiet_NaN());
}
void poison(BodyVelocitySample& sample) {
  sample.v_base_mps.setConstant(kNan);
  sample.w_base_radps.setConstant(kNan);
}
void poison(EncodedImage& /*image*/) {}  // scripts cannot ask for it

class NanStage final : public RandomStage {
 public:
  using RandomStage::RandomStage;

 protected:
  void strike(Event event, StreamId stream, std::vector<Event>& out) override {
    std::visit([](auto& sample) { poison(sample.sample); }, event);
    count(stream);
    out.push_back(std::move(event));
  }
};

class TruncateStage final : public RandomStage {
 public:
  using RandomStage::RandomStage;

 protected:
  void strike(Event event, StreamId stream, std::vector<Event>& out) override {
    if (auto* image = std::get_if<ImageArrival>(&event)) {
      auto& bytes = image->sample.bytes;
      bytes.resize(static_cast<std::size_t>(static_cast<double>(bytes.size()) * fault().keep));
      count(stream);
    }
    out.push_back(std::move(event));
  }
};

/// A black image without depth, of the size of what it replaces.
class CoverStage final : public RandomStage {
 public:
  using RandomStage::RandomStage;

 protected:
  void strike(Event event, StreamId stream, std::vector<Event>& out) override {
    if (auto* image = std::get_if<ImageArrival>(&event); image != nullptr && cover(image->sample)) {
      count(stream);
    }
    out.push_back(std::move(event));
  }

 private:
  /// False where no size can be read that an image has: the decoder will say so.
  static bool cover(EncodedImage& image) {
    if (image.encoding == ImageEncoding::kCompressed) {
      const auto header = read_header(image.bytes);
      if (!header || std::max(header->width, header->height) > kLargestSide) {
        return false;
      }
      const bool depth = image.stream == ImageStream::kDepth;
      const ImageShape shape{.width = header->width,
                             .height = header->height,
                             .format = depth ? PixelFormat::kDepth16 : PixelFormat::kGray8};
      image.encoding = ImageEncoding::kRaw;
      image.raw = {.shape = shape, .step_bytes = shape.row_bytes()};
      image.bytes.resize(shape.size_bytes());
    }
    std::ranges::fill(image.bytes, std::byte{0});
    return true;
  }
};

}  // namespace

bool is_clock_fault(FaultKind kind) noexcept {
  return kind == FaultKind::kClockOffset || kind == FaultKind::kClockDrift ||
         kind == FaultKind::kClockJump || kind == FaultKind::kClockWrap;
}

std::unique_ptr<Stage> make_stage(const Fault& fault, const StageContext& context) {
  switch (fault.kind) {
    case FaultKind::kDrop:
    case FaultKind::kGap:
      return std::make_unique<DropStage>(fault, context);
    case FaultKind::kDelay:
      return std::make_unique<DelayStage>(fault, context);
    case FaultKind::kDuplicate:
      return std::make_unique<DuplicateStage>(fault, context);
    case FaultKind::kReorder:
      return std::make_unique<ReorderStage>(fault, context);
    case FaultKind::kStuck:
      return std::make_unique<StuckStage>(fault, context);
    case FaultKind::kNan:
      return std::make_unique<NanStage>(fault, context);
    case FaultKind::kTruncate:
      return std::make_unique<TruncateStage>(fault, context);
    case FaultKind::kCover:
      return std::make_unique<CoverStage>(fault, context);
    case FaultKind::kClockOffset:
    case FaultKind::kClockDrift:
    case FaultKind::kClockJump:
    case FaultKind::kClockWrap:
      break;
  }
  return make_clock_stage(fault, context);
}

}  // namespace geoflow::drivers::faults
