#include <memory>

#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"

#include "dds/channel.hpp"

// Stands in for cyclone.cpp where the program is built without Cyclone DDS.
namespace geoflow::drivers::dds {
namespace {

tl::unexpected<Error> absent(const Address& address) {
  return fail(ErrorCode::kUnsupported,
              "{}: this program was built without DDS; it needs cyclonedds-dev and "
              "cyclonedds-tools when it is built",
              address.to_string());
}

}  // namespace

Result<std::unique_ptr<Channel>> make_subscriber(const Address& address) {
  return absent(address);
}

Result<std::unique_ptr<Publisher>> make_publisher(const Address& address) {
  return absent(address);
}

}  // namespace geoflow::drivers::dds
