#include <cstddef>
#include <cstdint>
#include <string_view>

#include "replay/faults/script.hpp"

/// Fault scripts from any bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const void* bytes = data;
  const auto script =
      geoflow::drivers::faults::parse_script("script", {static_cast<const char*>(bytes), size});
  return script ? 0 : 0;
}
