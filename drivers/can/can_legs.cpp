#include "geoflow/drivers/can_legs.hpp"

#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"

#include "can/leg_dictionary.hpp"
#include "can/legs_source.hpp"
#include "can/socket_channel.hpp"
#include "replay/text.hpp"

namespace geoflow::drivers {

Result<std::unique_ptr<Legs>> open_can_legs(const CanLegsOptions& options) {
  auto dictionary = can::LegDictionary::load(options.dictionary);
  if (!dictionary) {
    return tl::unexpected{std::move(dictionary.error())};
  }
  std::vector<std::string> interfaces;
  for (const std::string_view name : text::split(options.interfaces, ',')) {
    if (name.empty()) {
      return fail(ErrorCode::kInvalidArgument,
                  "'{}' are no names of interfaces with commas between them", options.interfaces);
    }
    interfaces.emplace_back(name);
  }
  std::ofstream log;
  if (!options.log.empty()) {
    log.open(options.log);
    if (!log) {
      return fail_errno(options.log.string());
    }
  }
  auto channel = can::SocketChannel::create(interfaces, dictionary->identifiers());
  if (!channel) {
    return tl::unexpected{std::move(channel.error())};
  }
  return std::make_unique<can::LegsSource>(*std::move(dictionary), *std::move(channel),
                                           std::move(interfaces), std::move(log));
}

}  // namespace geoflow::drivers
