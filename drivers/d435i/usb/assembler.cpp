#include "d435i/usb/assembler.hpp"

#include <cstddef>
#include <span>
#include <string_view>

#include "d435i/uvc/payload.hpp"

namespace geoflow::drivers::d435i {

FrameAssembler::Outcome FrameAssembler::add(std::span<const std::byte> payload) {
  Outcome outcome;
  if (complete_) {
    give_up();
    complete_ = false;
  }
  if (payload.empty()) {
    return outcome;
  }
  const auto header = parse_payload_header(payload);
  if (!header) {
    give_up();
    outcome.damage = "a payload without a header that can be read";
    return outcome;
  }
  const auto data = payload.subspan(header->length);
  if (skipped_id_ == header->frame_id) {
    skipped_id_ = header->end_of_frame ? std::nullopt : skipped_id_;
    return outcome;
  }
  skipped_id_.reset();
  if (!pixels_.empty() && header->frame_id != frame_id_) {
    give_up();
    outcome.damage = "a frame ended early";
  }
  const auto refuse = [&](std::string_view why) {
    give_up();
    outcome.damage = why;
    if (!header->end_of_frame) {
      skipped_id_ = header->frame_id;
    }
  };
  if (header->error) {
    refuse("the camera says that a frame is damaged");
  } else if (pixels_.size() + data.size() > frame_bytes_) {
    refuse("a frame is too long");
  } else if (pixels_.empty() && data.size() == frame_bytes_) {
    outcome.pixels = data;
    outcome.header = payload.first(header->length);
  } else if (pixels_.size() + data.size() < frame_bytes_ && header->end_of_frame) {
    if (!data.empty() || !pixels_.empty()) {
      refuse("a frame ended early");
    }
  } else {
    if (pixels_.empty()) {
      header_.assign(payload.begin(), payload.begin() + header->length);
      frame_id_ = header->frame_id;
    }
    pixels_.insert(pixels_.end(), data.begin(), data.end());
    if (pixels_.size() == frame_bytes_) {
      complete_ = true;
      outcome.pixels = pixels_;
      outcome.header = header_;
    }
  }
  return outcome;
}

}  // namespace geoflow::drivers::d435i
