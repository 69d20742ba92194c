#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {

/// Memory that this process fills, slot after slot, and that any other may map for reading: a
/// memfd, sealed so that nobody can change its size, and nobody else its bytes. Readers are not
/// waited for, and take nothing: they see from a slot's generation whether they were too late
/// (geoflow_slot). Thread-compatible.
class FrameRing {
 public:
  /// With room for frames of `frame_bytes` in each of `slots` slots. `name` is what /proc shows.
  /// kSystem where the system does not give it.
  [[nodiscard]] static Result<FrameRing> create(const char* name, std::uint32_t slots,
                                                std::size_t frame_bytes);
  FrameRing(FrameRing&& other) noexcept;
  FrameRing& operator=(FrameRing&&) = delete;
  FrameRing(const FrameRing&) = delete;
  FrameRing& operator=(const FrameRing&) = delete;
  ~FrameRing();

  /// Where a frame is, while it is there.
  struct Place {
    std::uint32_t slot = 0;
    std::uint64_t generation = 0;
  };
  /// Copies a frame to the next slot. Precondition: it has at most frame_bytes().
  Place write(std::span<const std::byte> frame) noexcept;

  [[nodiscard]] int fd() const noexcept { return fd_.get(); }
  [[nodiscard]] std::uint32_t slots() const noexcept { return slots_; }
  [[nodiscard]] std::size_t slot_bytes() const noexcept { return slot_bytes_; }
  [[nodiscard]] std::size_t frame_bytes() const noexcept;
  [[nodiscard]] std::size_t bytes() const noexcept { return memory_.size(); }

 private:
  FrameRing(UniqueFd fd, std::span<std::byte> memory, std::uint32_t slots) noexcept;

  UniqueFd fd_;
  std::span<std::byte> memory_;  // mapped
  std::uint32_t slots_;
  std::size_t slot_bytes_;
  std::uint64_t written_ = 0;
};

}  // namespace geoflow::daemon
