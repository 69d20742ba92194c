#pragma once

namespace geoflow {

/// Lets all other threads go before the calling one, of this process and of others (nice 10), from
/// here on. For work that others must not wait for. It needs no privilege and cannot be taken back
/// without one.
void give_way() noexcept;

}  // namespace geoflow
