#include <cstddef>
#include <cstdint>
#include <string_view>

#include "reasoned.hpp"
#include "replay/faults/script.hpp"

/// Fault scripts from any bytes; what is refused has a reason.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const void* bytes = data;
  geoflow::tests::require_reason(
      geoflow::drivers::faults::parse_script("script", {static_cast<const char*>(bytes), size}));
  return 0;
}
