#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace geoflow::drivers::d435i {

/// Puts frames together from payloads. The D435i sends one payload a frame, which is passed on
/// where it lies; a frame in several is collected. Thread-bound.
class FrameAssembler {
 public:
  /// `frame_bytes`: what a whole frame has.
  explicit FrameAssembler(std::size_t frame_bytes) : frame_bytes_{frame_bytes} {}

  /// What a payload brought. Views hold until the next add().
  struct Outcome {
    std::span<const std::byte> pixels{};  ///< of a whole frame; empty: none is complete
    std::span<const std::byte> header{};  ///< of its first payload
    std::string_view damage{};            ///< why a frame was given up; empty: none was
  };
  [[nodiscard]] Outcome add(std::span<const std::byte> payload);

 private:
  void give_up() noexcept { pixels_.clear(); }

  std::size_t frame_bytes_;
  std::vector<std::byte> pixels_;  // of a frame that is not complete yet
  std::vector<std::byte> header_;
  bool frame_id_ = false;
  bool complete_ = false;  // pixels_ were handed out and go with the next payload
  /// The rest of a frame that was given up is passed over.
  std::optional<bool> skipped_id_{};
};

}  // namespace geoflow::drivers::d435i
