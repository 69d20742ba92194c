#pragma once

#include <atomic>
#include <bit>
#include <cstddef>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

namespace geoflow::timesync {

/// The distance that keeps two threads' data out of one cache line.
inline constexpr std::size_t kCacheLineBytes = 64;

/// A bounded, lock-free, wait-free first-in-first-out queue between exactly one producer thread and
/// one consumer thread. Full: try_push refuses and the producer decides (for streams where every
/// sample counts: IMU, legs).
///
/// Each side owns one index and keeps a cached copy of the other's, so that the shared line is read
/// only when the ring looks full or empty (the scheme of rigtorp::SPSCQueue). Waiting is kept out
/// of the queue: see Doorbell. Allocates in the constructor only.
template <typename T>
class SpscRing {
  static_assert(std::is_nothrow_move_constructible_v<T> && std::is_nothrow_destructible_v<T>);

 public:
  /// Holds at least `capacity` (at least 1) elements: rounded up to a power of two.
  explicit SpscRing(std::size_t capacity)
      : slots_(std::bit_ceil(capacity < 1 ? 1 : capacity)), mask_{slots_.size() - 1} {}
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;
  /// No other thread may be using the ring.
  ~SpscRing() {
    while (try_pop()) {
    }
  }

  /// Producer thread only. False, and `value` untouched, when full.
  [[nodiscard]] bool try_push(T&& value) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - cached_head_ == slots_.size()) {
      cached_head_ = head_.load(std::memory_order_acquire);
      if (tail - cached_head_ == slots_.size()) {
        return false;
      }
    }
    std::construct_at(&slots_[tail & mask_].value, std::move(value));
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }
  /// Producer thread only. Copies; false when full.
  [[nodiscard]] bool try_push(const T& value) { return try_push(T{value}); }

  /// Consumer thread only. The oldest element, or nothing when empty.
  [[nodiscard]] std::optional<T> try_pop() noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == cached_tail_) {
      cached_tail_ = tail_.load(std::memory_order_acquire);
      if (head == cached_tail_) {
        return std::nullopt;
      }
    }
    T& value = slots_[head & mask_].value;
    std::optional<T> taken{std::move(value)};
    std::destroy_at(&value);
    head_.store(head + 1, std::memory_order_release);
    return taken;
  }

  /// How many elements are held; from any thread, exact only while both sides rest.
  [[nodiscard]] std::size_t size() const noexcept {
    const std::size_t head = head_.load(std::memory_order_acquire);
    return tail_.load(std::memory_order_acquire) - head;
  }
  [[nodiscard]] std::size_t capacity() const noexcept { return slots_.size(); }

 private:
  union Slot {  // raw storage: the ring constructs and destroys `value`
    Slot() noexcept {}
    Slot(const Slot&) = delete;
    Slot& operator=(const Slot&) = delete;
    ~Slot() {}
    T value;
  };

  std::vector<Slot> slots_;
  std::size_t mask_;
  alignas(kCacheLineBytes) std::atomic<std::size_t> head_{0};  // written by the consumer
  std::size_t cached_tail_ = 0;                                // consumer's
  alignas(kCacheLineBytes) std::atomic<std::size_t> tail_{0};  // written by the producer
  std::size_t cached_head_ = 0;                                // producer's
};

}  // namespace geoflow::timesync
