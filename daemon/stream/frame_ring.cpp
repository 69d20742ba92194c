#include "stream/frame_ring.hpp"

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/types.h>
#include <unistd.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/unique_fd.hpp"

namespace geoflow::daemon {
namespace {

constexpr std::size_t kPageBytes = 4096;
constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL;

}  // namespace

Result<FrameRing> FrameRing::create(const char* name, std::uint32_t slots,
                                    std::size_t frame_bytes) {
  const std::size_t pages = (sizeof(geoflow_slot) + frame_bytes + kPageBytes - 1) / kPageBytes;
  const std::size_t bytes = slots * pages * kPageBytes;
  UniqueFd fd{::memfd_create(name, MFD_CLOEXEC | MFD_ALLOW_SEALING)};
  if (!fd || ::ftruncate(fd.get(), static_cast<off_t>(bytes)) != 0) {
    return fail_errno(name);
  }
  void* const memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd.get(), 0);
  if (memory == MAP_FAILED) {  // NOLINT(performance-no-int-to-ptr): the system's
    return fail_errno(name);
  }
  FrameRing ring{std::move(fd), {static_cast<std::byte*>(memory), bytes}, slots};
  if (::fcntl(ring.fd(), F_ADD_SEALS, kSeals) != 0) {
    return fail_errno(name);
  }
  return ring;
}

FrameRing::FrameRing(UniqueFd fd, std::span<std::byte> memory, std::uint32_t slots) noexcept
    : fd_{std::move(fd)}, memory_{memory}, slots_{slots}, slot_bytes_{memory.size() / slots} {}

FrameRing::FrameRing(FrameRing&& other) noexcept
    : fd_{std::move(other.fd_)},
      memory_{std::exchange(other.memory_, {})},
      slots_{other.slots_},
      slot_bytes_{other.slot_bytes_},
      written_{other.written_} {}

FrameRing::~FrameRing() {
  if (!memory_.empty()) {
    ::munmap(memory_.data(), memory_.size());
  }
}

std::size_t FrameRing::frame_bytes() const noexcept {
  return slot_bytes_ - sizeof(geoflow_slot);
}

FrameRing::Place FrameRing::write(std::span<const std::byte> frame) noexcept {
  const auto slot = static_cast<std::uint32_t>(written_ % slots_);
  const std::span<std::byte> memory = memory_.subspan(slot * slot_bytes_, slot_bytes_);
  void* const begin = memory.data();  // on a page
  const std::atomic_ref<std::uint64_t> generation{static_cast<geoflow_slot*>(begin)->generation};
  const std::uint64_t finished = 2 * ++written_;
  generation.store(finished - 1, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_release);
  std::ranges::copy(frame, memory.subspan(sizeof(geoflow_slot)).begin());
  generation.store(finished, std::memory_order_release);
  return {.slot = slot, .generation = finished};
}

}  // namespace geoflow::daemon
