#include "src/video_stream.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/byte_writer.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

#include "src/image_packer.hpp"
#include "src/pace.hpp"
#include "src/payload_header.hpp"
#include "src/stream_table.hpp"
#include "src/uvc_controls.hpp"

namespace geoflow::emulator {
namespace {

enum Selector : std::uint8_t { kProbe = 1, kCommit = 2 };

constexpr std::size_t kBlockSize = 48;
constexpr std::size_t kFormatAt = 2;
constexpr std::size_t kFrameAt = 3;
constexpr std::size_t kIntervalAt = 4;
constexpr std::size_t kLeastBlock = 8;  // up to the interval: what decides
constexpr std::uint32_t kLongestHeader = 255;
constexpr std::uint32_t kClockHz = 48'000'000;
constexpr std::size_t kMostFrames = 4;  // not yet fetched
constexpr Duration kIntervalUnit{100};
// A host that wants frames asks all the time; a slow one may be busy for some of it.
constexpr Duration kLongestSilence = std::chrono::seconds{2};

}  // namespace

VideoStream::VideoStream(VideoStreamId id, const Calibration& calibration)
    : id_{id},
      interface_{video_interfaces()[static_cast<std::size_t>(id)]},
      calibration_{calibration},
      probe_{nearest({})},
      choice_{probe_} {}

const VideoFormat& VideoStream::format(const Choice& choice) const {
  return interface_.formats[choice.format - 1U];
}

const FrameSize& VideoStream::size(const Choice& choice) const {
  return format(choice).sizes[choice.frame - 1U];
}

VideoStream::Choice VideoStream::nearest(Choice wanted) const {
  if (wanted.format < 1 || wanted.format > interface_.formats.size()) {
    wanted.format = 1;
  }
  if (wanted.frame < 1 || wanted.frame > format(wanted).sizes.size()) {
    wanted.frame = 1;
  }
  const auto intervals = size(wanted).intervals_100ns;
  const auto distance = [&](std::uint32_t interval) {
    return interval > wanted.interval_100ns ? interval - wanted.interval_100ns
                                            : wanted.interval_100ns - interval;
  };
  wanted.interval_100ns = *std::min_element(
      intervals.begin(), intervals.end(),
      [&](std::uint32_t a, std::uint32_t b) { return distance(a) < distance(b); });
  return wanted;
}

Bytes VideoStream::block(const Choice& choice) const {
  constexpr unsigned kFrameIdAndEndOfFrame = 3;
  const std::uint32_t frame = frame_bytes(format(choice), size(choice));
  ByteWriter to;
  to.u16(0).put(choice.format).put(choice.frame).put(choice.interval_100ns);
  to.u16(0).u16(0).u16(0).u16(0).u16(0);  // key frames, P frames, quality, window, delay
  to.put(frame).put(frame + kLongestHeader).put(kClockHz).u8(kFrameIdAndEndOfFrame);
  return to.pad_to(kBlockSize).take();
}

std::optional<Bytes> VideoStream::request(const SetupPacket& setup,
                                          std::span<const std::byte> out) {
  constexpr unsigned kByteBits = 8;
  const auto selector = static_cast<std::uint8_t>(setup.value >> kByteBits);
  if (selector != kProbe && selector != kCommit) {
    return std::nullopt;
  }
  switch (static_cast<UvcRequest>(setup.request)) {
    case UvcRequest::kSetCur: {
      if (out.size() < kLeastBlock) {
        return std::nullopt;
      }
      const auto at = [&](std::size_t i) { return std::to_integer<std::uint32_t>(out[i]); };
      std::uint32_t interval = 0;
      for (std::size_t i = kIntervalAt + sizeof interval; i-- > kIntervalAt;) {
        interval = (interval << kByteBits) | at(i);
      }
      probe_ = nearest({.format = static_cast<std::uint8_t>(at(kFormatAt)),
                        .frame = static_cast<std::uint8_t>(at(kFrameAt)),
                        .interval_100ns = interval});
      if (selector == kCommit) {
        commit(probe_);
      }
      return Bytes{};
    }
    case UvcRequest::kGetCur:
    case UvcRequest::kGetMin:
    case UvcRequest::kGetMax:
    case UvcRequest::kGetDef:
      return block(selector == kCommit ? choice_ : probe_);
    case UvcRequest::kGetLen:
      return ByteWriter{}.u16(kBlockSize).take();
    case UvcRequest::kGetInfo:
      return ByteWriter{}.u8(3).take();  // get and set
    default:
      return std::nullopt;
  }
}

void VideoStream::commit(const Choice& choice) {
  choice_ = choice;
  packer_.emplace(calibration_.camera, format(choice).packing, size(choice));
  committed_ = true;
  fetched_ = false;
  counter_ = 0;
  odd_ = false;
  clear();
}

void VideoStream::see(SeenFrame frame) {
  if (!active() || !is_due(due_, frame.t, choice_.interval_100ns * kIntervalUnit)) {
    return;
  }
  if (frames_.size() == kMostFrames) {
    frames_.pop_front();
    ++dropped_;
  }
  frames_.push_back({std::move(frame), ++counter_});
}

std::optional<Bytes> VideoStream::fetch(const UvcControls& controls, HostTime now) {
  fetched_ = committed_;
  fetched_at_ = now;
  if (frames_.empty()) {
    return std::nullopt;
  }
  const Numbered next = std::move(frames_.front());
  frames_.pop_front();
  const FrameSize& shape = size(choice_);
  const auto interval = choice_.interval_100ns * kIntervalUnit;
  const FrameFacts facts{
      .color = id_ == VideoStreamId::kColor,
      .odd = std::exchange(odd_, !odd_),
      .counter = next.counter,
      .stamp_us = next.frame.stamp_us,
      .since_exposure_us = next.frame.since_exposure_us,
      .interval_us = static_cast<std::uint32_t>(
          std::chrono::duration_cast<std::chrono::microseconds>(interval).count()),
      .format_code = format(choice_).metadata_code,
      .width = shape.width,
      .height = shape.height,
      .fps = static_cast<std::uint16_t>(frames_per_second(choice_.interval_100ns))};
  ByteWriter payload;
  payload.reserve(frame_bytes(format(choice_), shape) + kLongestHeader);
  put_payload_header(facts, controls, payload);
  packer_->pack(next.frame.color, next.frame.depth, calibration_.depth_unit_m, payload);
  ++sent_;
  return payload.take();
}

void VideoStream::clear() {
  fetched_ = false;
  due_.reset();
  frames_.clear();
}

bool VideoStream::end_if_left(HostTime now) {
  const bool left = active() && now - fetched_at_ > kLongestSilence;
  if (left) {
    clear();
  }
  return left;
}

void VideoStream::reset() {
  clear();
  committed_ = false;
  probe_ = nearest({});
  choice_ = probe_;
}

}  // namespace geoflow::emulator
