#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

/// Images in pooled memory. A frame is written once by the thread that acquired it, then only read.
namespace geoflow {

enum class PixelFormat : std::uint8_t {
  kGray8,    ///< 1 byte a pixel
  kRgb8,     ///< 3 bytes a pixel, red first
  kBgr8,     ///< 3 bytes a pixel, blue first
  kYuyv,     ///< 2 bytes a pixel, Y0 U Y1 V
  kDepth16,  ///< 2 bytes a pixel, host byte order, in units of Calibration::depth_unit_m; 0 = no
             ///< measurement
};

[[nodiscard]] constexpr std::size_t bytes_per_pixel(PixelFormat format) noexcept {
  switch (format) {
    case PixelFormat::kGray8:
      return 1;
    case PixelFormat::kRgb8:
    case PixelFormat::kBgr8:
      return 3;
    case PixelFormat::kYuyv:
    case PixelFormat::kDepth16:
      return 2;
  }
  return 0;
}

/// Width and height [px] and meaning of an image's pixels; rows are contiguous (stride = width *
/// bytes_per_pixel).
struct ImageShape {
  int width = 0;
  int height = 0;
  PixelFormat format = PixelFormat::kGray8;

  [[nodiscard]] constexpr std::size_t row_bytes() const noexcept {
    return static_cast<std::size_t>(width) * bytes_per_pixel(format);
  }
  [[nodiscard]] constexpr std::size_t size_bytes() const noexcept {
    return row_bytes() * static_cast<std::size_t>(height);
  }
  friend constexpr bool operator==(const ImageShape&, const ImageShape&) = default;
};

class FramePool;

/// A counted reference to one pooled image; empty when default-constructed. Copies share the
/// pixels; the last one to go returns the memory to its pool, which it keeps alive. Distinct
/// references may be used from distinct threads.
class FrameRef {
 public:
  FrameRef() noexcept = default;

  [[nodiscard]] explicit operator bool() const noexcept { return slot_ != nullptr; }
  [[nodiscard]] const ImageShape& shape() const noexcept { return slot_->shape; }

  /// All bytes, row by row. Precondition for these and shape(): not empty.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept {
    return {slot_->memory.data(), slot_->shape.size_bytes()};
  }
  /// Only for the thread that acquired the frame, before it is shared.
  [[nodiscard]] std::span<std::byte> writable_bytes() noexcept {
    return {slot_->memory.data(), slot_->shape.size_bytes()};
  }
  /// The first pixel of a row as `Pixel` (std::uint8_t or std::uint16_t).
  template <typename Pixel>
  [[nodiscard]] const Pixel* row(int y) const noexcept {
    const void* first =
        slot_->memory.data() + static_cast<std::size_t>(y) * slot_->shape.row_bytes();
    return static_cast<const Pixel*>(first);
  }

 private:
  friend class FramePool;
  struct Slot {
    ImageShape shape;
    std::vector<std::byte> memory;
    std::atomic<bool> in_use = false;
  };
  explicit FrameRef(std::shared_ptr<Slot> slot) noexcept : slot_{std::move(slot)} {}

  std::shared_ptr<Slot> slot_;
};

/// A fixed number of image buffers, each grown once to the largest size asked of it. Thread-safe,
/// lock-free.
class FramePool {
 public:
  explicit FramePool(std::size_t capacity);

  /// A frame of that shape with unspecified content, or an empty reference when all buffers are in
  /// use: the caller drops and counts. Never blocks.
  [[nodiscard]] FrameRef acquire(const ImageShape& shape);

  [[nodiscard]] std::size_t capacity() const noexcept { return slots_->size(); }

 private:
  std::shared_ptr<std::vector<FrameRef::Slot>> slots_;
};

}  // namespace geoflow
