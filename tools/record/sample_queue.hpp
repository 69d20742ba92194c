#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>
#include <variant>

#include "geoflow/daemon/started_ports.hpp"
#include "geoflow/drivers/faults.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tools {

/// Any sample as a port delivers it.
using AnySample = std::variant<Arrival<CameraClock, ColorFrame>, Arrival<CameraClock, DepthFrame>,
                               Arrival<ImuClock, ImuSample>, Arrival<LegClock, LegSample>,
                               Arrival<LegClock, BodyVelocitySample>>;

/// How much a queue may hold before samples are lost.
struct QueueLimits {
  // A camera's driver has 48 buffers (drivers/d435i/device/samples.cpp), and needs some itself.
  std::size_t images =
      40;  ///< of both kinds  NOLINT(readability-magic-numbers): named by its member
  std::size_t samples = 65536;  ///< of all other kinds together: a minute of legs and an IMU
};

/// Between the threads that bring samples and the one that writes them to a disk, which may take
/// its time: what comes first goes first, and a sample that finds no room is lost and counted.
/// The on_… functions and dropped() are thread-safe; pop() is for one thread.
class SampleQueue final : public daemon::SampleReceiver {
 public:
  explicit SampleQueue(const QueueLimits& limits) : limits_{limits} {}

  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override { push(frame, true); }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override { push(frame, true); }
  void on_imu(const Arrival<ImuClock, ImuSample>& sample) override { push(sample, false); }
  void on_legs(const Arrival<LegClock, LegSample>& sample) override { push(sample, false); }
  void on_body_velocity(const Arrival<LegClock, BodyVelocitySample>& sample) override {
    push(sample, false);
  }

  /// The oldest sample; none where none came within `timeout`.
  [[nodiscard]] std::optional<AnySample> pop(Duration timeout) {
    std::unique_lock lock{mutex_};
    if (!wake_.wait_for(lock, timeout, [this] { return !samples_.empty(); })) {
      return std::nullopt;
    }
    std::optional<AnySample> oldest{std::move(samples_.front())};
    samples_.pop_front();
    images_ -= is_image(*oldest) ? 1U : 0U;
    return oldest;
  }

  /// Samples that found no room.
  [[nodiscard]] std::uint64_t dropped() const noexcept {
    return dropped_.load(std::memory_order_relaxed);
  }

 private:
  static bool is_image(const AnySample& sample) noexcept { return sample.index() < 2; }

  void push(AnySample sample, bool image) {
    const std::scoped_lock lock{mutex_};
    const std::size_t others = samples_.size() - images_;
    if (image ? images_ >= limits_.images : others >= limits_.samples) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    images_ += image ? 1U : 0U;
    samples_.push_back(std::move(sample));
    wake_.notify_one();
  }

  QueueLimits limits_;
  std::mutex mutex_;  // samples_, images_
  std::condition_variable wake_;
  std::deque<AnySample> samples_;
  std::size_t images_ = 0;
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace geoflow::tools
