#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <variant>
#include <vector>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"

#include "replay/decode.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers {

/// An event whose image is decoded.
using DecodedEvent =
    std::variant<Arrival<CameraClock, ColorFrame>, Arrival<CameraClock, DepthFrame>,
                 Arrival<ImuClock, ImuSample>, Arrival<LegClock, LegSample>,
                 Arrival<LegClock, BodyVelocitySample>>;

/// What the reader gave at one call.
struct Prefetched {
  Result<std::optional<DecodedEvent>>
      event;                              ///< none at the end; an Error where a sample was rejected
  std::optional<FaultCounters> faults{};  ///< up to here, where a fault script is at work
  bool complete = true;                   ///< RecordingReader::complete()
};

/// Pools that grow, so that a replay never drops a frame that a consumer is slow to let go of.
/// Thread-bound.
class FrameStore {
 public:
  /// Empty once 1024 frames of one kind are in use.
  [[nodiscard]] FrameRef acquire(const ImageShape& shape);

 private:
  std::vector<FramePool> color_;
  std::vector<FramePool> depth_;
};

/// Reads and decodes ahead of its taker, on one thread of its own: at most `capacity` samples, in
/// the reader's order, none left out. take() and statistics() are thread-safe.
class Prefetcher {
 public:
  Prefetcher(std::unique_ptr<RecordingReader> reader, const DecodeOptions& options,
             std::size_t capacity);

  /// The next sample; waits for it. From the end on, the end again and again.
  [[nodiscard]] Prefetched take();

  [[nodiscard]] DecodeStatistics statistics() const;

 private:
  void run(const std::stop_token& stop);
  [[nodiscard]] Prefetched read_one();
  [[nodiscard]] Result<DecodedEvent> decode_event(const Arrival<CameraClock, EncodedImage>& image);
  template <typename Sample>
  [[nodiscard]] Result<DecodedEvent> decode_event(const Sample& sample) {
    return DecodedEvent{sample};
  }
  [[nodiscard]] Result<FrameRef> decode_timed(const EncodedImage& image);

  // Only the prefetching thread uses these once it runs.
  std::unique_ptr<RecordingReader> reader_;
  DecodeOptions options_;
  FrameStore frames_;

  std::size_t capacity_;
  mutable std::mutex mutex_;  // guards what follows; never held while decoding
  std::condition_variable_any changed_;
  std::deque<Prefetched> ready_;
  DecodeStatistics statistics_;
  std::jthread thread_;  // last: ends before what it uses
};

}  // namespace geoflow::drivers
