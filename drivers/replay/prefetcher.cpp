#include "replay/prefetcher.hpp"

#include <algorithm>
#include <cstddef>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <utility>
#include <variant>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/thread.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/decode.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

constexpr std::size_t kPoolFrames = 16;
constexpr std::size_t kMostPools = 64;

bool is_last(const Prefetched& item) {
  return item.event && !item.event->has_value();
}

}  // namespace

FrameRef FrameStore::acquire(const ImageShape& shape) {
  auto& pools = shape.format == PixelFormat::kDepth16 ? depth_ : color_;
  for (FramePool& pool : pools) {
    if (FrameRef frame = pool.acquire(shape)) {
      return frame;
    }
  }
  if (pools.size() == kMostPools) {
    return {};
  }
  return pools.emplace_back(kPoolFrames).acquire(shape);
}

Prefetcher::Prefetcher(std::unique_ptr<RecordingReader> reader, const DecodeOptions& options,
                       std::size_t capacity)
    : reader_{std::move(reader)},
      options_{options},
      capacity_{std::max<std::size_t>(capacity, 1)},
      thread_{[this](const std::stop_token& stop) { run(stop); }} {}

Prefetched Prefetcher::take() {
  std::unique_lock lock{mutex_};
  if (ready_.empty()) {
    const HostTime begin = HostClock::now();
    changed_.wait(lock, [this] { return !ready_.empty(); });
    statistics_.waited += HostClock::now() - begin;
  }
  if (is_last(ready_.front())) {
    return ready_.front();
  }
  Prefetched item = std::move(ready_.front());
  ready_.pop_front();
  lock.unlock();
  changed_.notify_all();
  return item;
}

DecodeStatistics Prefetcher::statistics() const {
  const std::scoped_lock lock{mutex_};
  return statistics_;
}

void Prefetcher::run(const std::stop_token& stop) {
  give_way();  // it is ahead of its taker
  bool last = false;
  while (!last) {
    Prefetched item = read_one();
    last = is_last(item);
    std::unique_lock lock{mutex_};
    if (!changed_.wait(lock, stop, [this] { return ready_.size() < capacity_; })) {
      return;
    }
    ready_.push_back(std::move(item));
    lock.unlock();
    changed_.notify_all();
  }
}

Prefetched Prefetcher::read_one() {
  Prefetched item;
  try {
    auto event = reader_->next();
    if (!event) {
      item.event = tl::unexpected{std::move(event.error())};
    } else if (const std::optional<Event>& found = *event) {
      item.event = std::visit([this](const auto& sample) { return decode_event(sample); }, *found);
    } else {
      item.event = std::nullopt;
    }
  } catch (const std::exception& exception) {
    item.event = fail(ErrorCode::kSystem, "a sample could not be read: {}", exception.what());
  }
  if (const FaultCounters* faults = reader_->faults()) {
    item.faults = *faults;
  }
  item.complete = reader_->complete();
  return item;
}

Result<DecodedEvent> Prefetcher::decode_event(const Arrival<CameraClock, EncodedImage>& image) {
  auto frame = decode_timed(image.sample);
  if (!frame) {
    return tl::unexpected{std::move(frame.error())};
  }
  if (image.sample.stream == ImageStream::kDepth) {
    return Arrival<CameraClock, DepthFrame>{
        .t_device = image.t_device, .t_arrival = image.t_arrival, .sample = {*std::move(frame)}};
  }
  return Arrival<CameraClock, ColorFrame>{
      .t_device = image.t_device, .t_arrival = image.t_arrival, .sample = {*std::move(frame)}};
}

Result<FrameRef> Prefetcher::decode_timed(const EncodedImage& image) {
  const HostTime begin = HostClock::now();
  auto frame =
      decode(image, options_, [this](const ImageShape& shape) { return frames_.acquire(shape); });
  const Duration spent = HostClock::now() - begin;
  const std::scoped_lock lock{mutex_};
  ++statistics_.images;
  statistics_.total += spent;
  statistics_.longest = std::max(statistics_.longest, spent);
  return frame;
}

}  // namespace geoflow::drivers
