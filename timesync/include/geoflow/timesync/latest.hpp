#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <utility>

#include "geoflow/timesync/spsc_ring.hpp"

namespace geoflow::timesync {

/// The newest value of something, from exactly one writer thread to exactly one reader thread;
/// older ones are overwritten unread. Wait-free on both sides: one exchange each.
///
/// A triple buffer: the writer owns one cell, the reader one, and the third is exchanged through an
/// atomic that holds its index and whether it is unread. T must be default-constructible and
/// assignable; assignment runs on the caller's thread into a cell that it alone owns.
template <typename T>
class Latest {
 public:
  Latest() = default;
  Latest(const Latest&) = delete;
  Latest& operator=(const Latest&) = delete;
  ~Latest() = default;

  /// Writer thread only.
  void store(T value) {
    cells_[writer_].value = std::move(value);
    writer_ = middle_.exchange(writer_ | kUnread, std::memory_order_acq_rel) & kIndex;
  }

  /// Reader thread only. The newest value if one was stored since the last call, else nothing.
  [[nodiscard]] std::optional<T> take_new() {
    if ((middle_.load(std::memory_order_relaxed) & kUnread) == 0) {
      return std::nullopt;
    }
    reader_ = middle_.exchange(reader_, std::memory_order_acq_rel) & kIndex;
    ever_ = true;
    return cells_[reader_].value;
  }

  /// Reader thread only. The newest value stored so far, seen before or not; nothing if there never
  /// was one.
  [[nodiscard]] std::optional<T> load() {
    if (std::optional<T> fresh = take_new()) {
      return fresh;
    }
    return ever_ ? std::optional<T>{cells_[reader_].value} : std::nullopt;
  }

 private:
  static constexpr std::uint8_t kUnread = 4;
  static constexpr std::uint8_t kIndex = 3;
  struct alignas(kCacheLineBytes) Cell {
    T value{};
  };

  std::array<Cell, 3> cells_{};
  alignas(kCacheLineBytes) std::atomic<std::uint8_t> middle_{1};
  alignas(kCacheLineBytes) std::uint8_t writer_ = 0;
  alignas(kCacheLineBytes) std::uint8_t reader_ = 2;
  bool ever_ = false;
};

}  // namespace geoflow::timesync
