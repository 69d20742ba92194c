#include "geoflow/tools/emulator/in_pipe.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "geoflow/hal/time.hpp"
#include "geoflow/tools/emulator/usb_device.hpp"

namespace geoflow::emulator {

InTransfer InPipe::read(std::size_t length, HostTime now) {
  if (!under_way_) {
    InTransfer next = device_.next_in(endpoint_, now);
    if (next.status != InStatus::kData || next.data.size() < length) {
      return next;
    }
    transfer_ = std::move(next.data);
    sent_ = 0;
  }
  const std::size_t count = std::min(length, transfer_.size() - sent_);
  const auto begin = transfer_.begin() + static_cast<std::ptrdiff_t>(sent_);
  InTransfer piece{.status = InStatus::kData,
                   .data = Bytes(begin, begin + static_cast<std::ptrdiff_t>(count))};
  sent_ += count;
  under_way_ = count == length;
  return piece;
}

void InPipe::clear() noexcept {
  under_way_ = false;
}

}  // namespace geoflow::emulator
