#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string_view>

#include "can/dbc/database.hpp"
#include "can/dbc/signal.hpp"
#include "can/frame.hpp"
#include "can/leg_dictionary.hpp"
#include "reasoned.hpp"

// Any text as a DBC file, and as a dictionary of legs: read or refused with a reason; every signal
// that is accepted can be read from and written to a frame of its message.

namespace can = geoflow::drivers::can;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // NOLINTNEXTLINE(bugprone-casting-through-void): bytes as text
  const std::string_view text{static_cast<const char*>(static_cast<const void*>(data)), size};
  const auto database = can::dbc::parse(text, "any.dbc");
  geoflow::tests::require_reason(database);
  if (!database) {
    return 0;
  }
  for (const auto& message : database->messages) {
    for (const auto& signal : message.signals) {
      std::array<std::byte, can::kFdBytes> bytes{};
      const auto payload = std::span{bytes}.first(message.length);
      can::dbc::write_bits(signal.field, ~std::uint64_t{0}, payload);
      const double value = signal.decode(payload);
      signal.encode(value, payload);
      if (signal.field.bits < 64 && signal.raw(payload) >> signal.field.bits != 0) {
        std::abort();
      }
    }
  }
  const auto dictionary = can::LegDictionary::from(*database);
  geoflow::tests::require_reason(dictionary);
  if (dictionary) {
    for (const auto& identifier : dictionary->identifiers()) {
      (void)dictionary->match({.id = identifier.id,
                               .extended = identifier.extended,
                               .length = static_cast<std::uint8_t>(identifier.length)});
    }
  }
  return 0;
}
