#include "geoflow/hal/image.hpp"

#include <atomic>
#include <cstddef>
#include <memory>
#include <vector>

namespace geoflow {

FramePool::FramePool(std::size_t capacity)
    : slots_{std::make_shared<std::vector<FrameRef::Slot>>(capacity)} {}

FrameRef FramePool::acquire(const ImageShape& shape) {
  for (FrameRef::Slot& slot : *slots_) {
    if (slot.in_use.exchange(true, std::memory_order_acquire)) {
      continue;
    }
    slot.shape = shape;
    if (slot.memory.size() < shape.size_bytes()) {
      slot.memory.resize(shape.size_bytes());
    }
    // The deleter shares ownership of all slots, so a frame outlives its pool.
    return FrameRef{std::shared_ptr<FrameRef::Slot>{&slot, [slots = slots_](FrameRef::Slot* used) {
                                                      used->in_use.store(false,
                                                                         std::memory_order_release);
                                                    }}};
  }
  return {};
}

}  // namespace geoflow
