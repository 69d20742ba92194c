#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace geoflow::timesync {

/// One sample's two times [ns].
struct StampPair {
  std::int64_t device_ns = 0;   ///< unwrapped
  std::int64_t arrival_ns = 0;  ///< on the host
};

/// Of each block of device time the least delayed sample, for the last 32 blocks. Thread-bound; no
/// allocation; O(1).
class BlockMinima {
 public:
  static constexpr std::size_t kBlocks = 32;

  /// Takes one accepted sample. True when it is the first of a new block, so that the one before
  /// has been closed.
  [[nodiscard]] bool add(const StampPair& pair, double residual_ns, std::int64_t block_ns) noexcept;
  /// The open block's lowest sample is measured against a line that has moved down by so much.
  void lower_line_by(double step_ns) noexcept { lowest_residual_ns_ += step_ns; }
  void reset() noexcept { *this = BlockMinima{}; }

  /// How many blocks are kept, and the i-th of them, oldest first, by strictly increasing device
  /// time.
  [[nodiscard]] std::size_t size() const noexcept { return closed_ < kBlocks ? closed_ : kBlocks; }
  [[nodiscard]] const StampPair& operator[](std::size_t i) const noexcept {
    return pairs_[(closed_ - size() + i) % kBlocks];
  }

 private:
  std::array<StampPair, kBlocks> pairs_{};
  std::size_t closed_ = 0;
  bool open_ = false;
  std::int64_t start_ns_ = 0;
  StampPair lowest_;
  double lowest_residual_ns_ = 0;
};

}  // namespace geoflow::timesync
