#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "can/candump.hpp"
#include "reasoned.hpp"

// Any line of a CAN log: read or refused with a reason; what was read is written so that it is read
// as the same frame.

namespace can = geoflow::drivers::can;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // NOLINTNEXTLINE(bugprone-casting-through-void): bytes as text
  const std::string_view text{static_cast<const char*>(static_cast<const void*>(data)), size};
  const auto line = can::parse_log_line(text);
  geoflow::tests::require_reason(line);
  if (!line) {
    return 0;
  }
  const std::string written = can::format_log_line(line->stamp, line->interface, line->frame);
  const auto again = can::parse_log_line(written);
  if (!again || again->frame != line->frame || again->interface != line->interface) {
    std::abort();
  }
  return 0;
}
