#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "geoflow/daemon/config.hpp"

/// Configurations from any bytes: an error that names where, or a configuration whose every value
/// is accepted again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace geoflow::daemon;
  const void* generic = data;
  const std::string_view text{static_cast<const char*>(generic), size};
  const auto config = parse_config(text, "fuzz");
  if (!config) {
    return config.error().message.starts_with("fuzz:") ? 0 : (std::abort(), 0);
  }
  std::string again;
  for (const auto& [key, value] : list_keys(*config)) {
    again.append(key).append(" = ").append(value).append("\n");
  }
  if (!parse_config(again, "again")) {
    std::abort();
  }
  return 0;
}
