#include "dds/channel.hpp"

#include <string>

#include <fmt/core.h>

namespace geoflow::drivers::dds {

std::string Address::to_string() const {
  return fmt::format("{} on {}, domain {}", topic, interface.empty() ? "any interface" : interface,
                     domain);
}

}  // namespace geoflow::drivers::dds
