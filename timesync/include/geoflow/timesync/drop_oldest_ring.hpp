#pragma once

#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "geoflow/timesync/spsc_ring.hpp"

namespace geoflow::timesync {

/// A bounded, lock-free queue between one producer and one consumer thread that, when full, gives
/// up its oldest element for the new one and counts it (for images: the newest matter, and the
/// memory is bounded).
///
/// In a plain SPSC ring the producer cannot drop the oldest: the consumer may be reading it. Here
/// each slot carries a sequence number that says whose turn it is (D. Vyukov's bounded MPMC queue,
/// 1024cores.net), and the head is claimed by compare-and-swap: by the consumer to take, or by the
/// producer to drop. Whoever wins owns the slot's content; the loser touches nothing. Sequence of
/// slot i: == p: free for position p; == p + 1: holds position p.
///
/// There are twice as many slots as elements may be held, so that the slot that the producer writes
/// next is free even while the consumer still moves an element out. Only if the consumer sleeps
/// inside that move for a whole lap is the slot busy: the new element is then dropped and counted.
/// push is wait-free (one compare-and-swap), try_pop lock-free; order is never violated. Allocates
/// in the constructor only. Waiting is kept out of the queue: see Doorbell.
template <typename T>
class DropOldestRing {
  static_assert(std::is_nothrow_move_constructible_v<T> && std::is_nothrow_destructible_v<T>);

 public:
  /// Holds at most `capacity` (at least 1) elements.
  explicit DropOldestRing(std::size_t capacity)
      : capacity_{capacity < 1 ? 1 : capacity},
        slots_(std::bit_ceil(2 * capacity_)),
        mask_{slots_.size() - 1} {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      slots_[i].sequence.store(i, std::memory_order_relaxed);
    }
  }
  DropOldestRing(const DropOldestRing&) = delete;
  DropOldestRing& operator=(const DropOldestRing&) = delete;
  /// No other thread may be using the ring.
  ~DropOldestRing() {
    while (try_pop()) {
    }
  }

  /// Producer thread only. Never blocks, never fails; at most one element (usually the oldest) is
  /// dropped and counted.
  void push(T value) noexcept {
    const std::size_t head = head_.load(std::memory_order_acquire);
    if (tail_ - head >= capacity_) {
      drop_oldest(head);
    }
    Slot& slot = slots_[tail_ & mask_];
    if (slot.sequence.load(std::memory_order_acquire) != tail_) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    std::construct_at(&slot.value, std::move(value));
    slot.sequence.store(tail_ + 1, std::memory_order_release);
    ++tail_;
  }

  /// Consumer thread only. The oldest element held, or nothing when empty.
  [[nodiscard]] std::optional<T> try_pop() noexcept {
    for (;;) {
      std::size_t head = head_.load(std::memory_order_acquire);
      if (slots_[head & mask_].sequence.load(std::memory_order_acquire) == head + 1) {
        if (head_.compare_exchange_weak(head, head + 1, std::memory_order_acq_rel,
                                        std::memory_order_relaxed)) {
          std::optional<T> taken{std::move(slots_[head & mask_].value)};
          release(head);
          return taken;
        }
      } else if (head == head_.load(std::memory_order_acquire)) {
        return std::nullopt;
      }  // else the producer dropped this very element meanwhile: there is a newer one
    }
  }

  /// Elements given up so far; from any thread.
  [[nodiscard]] std::uint64_t dropped() const noexcept {
    return dropped_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::size_t capacity() const noexcept { return capacity_; }

 private:
  struct Slot {
    Slot() noexcept {}
    Slot(const Slot&) = delete;
    Slot& operator=(const Slot&) = delete;
    ~Slot() {}
    std::atomic<std::size_t> sequence{0};
    union {  // raw storage: the ring constructs and destroys `value`
      T value;
    };
  };

  void drop_oldest(std::size_t head) noexcept {
    if (head_.compare_exchange_strong(head, head + 1, std::memory_order_acq_rel,
                                      std::memory_order_relaxed)) {
      release(head);
      dropped_.fetch_add(1, std::memory_order_relaxed);
    }  // else the consumer took it: there is room now
  }

  void release(std::size_t position) noexcept {
    Slot& slot = slots_[position & mask_];
    std::destroy_at(&slot.value);
    slot.sequence.store(position + slots_.size(), std::memory_order_release);
  }

  std::size_t capacity_;
  std::vector<Slot> slots_;
  std::size_t mask_;
  alignas(kCacheLineBytes) std::atomic<std::size_t> head_{0};  // claimed by either side
  alignas(kCacheLineBytes) std::size_t tail_ = 0;              // producer's
  std::atomic<std::uint64_t> dropped_{0};
};

}  // namespace geoflow::timesync
