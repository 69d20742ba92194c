#include <memory>
#include <string_view>

#include <tl/expected.hpp>

#include "geoflow/drivers/ros_publisher.hpp"
#include "geoflow/hal/result.hpp"

#include "dds/channel.hpp"

// Stands in for cyclone.cpp and ros_publisher.cpp where the program is built without Cyclone DDS.
namespace geoflow::drivers::dds {
namespace {

tl::unexpected<Error> absent(std::string_view what) {
  return fail(ErrorCode::kUnsupported,
              "{}: this program was built without DDS; it needs cyclonedds-dev and "
              "cyclonedds-tools when it is built",
              what);
}

}  // namespace

Result<std::unique_ptr<Channel>> make_subscriber(const Address& address) {
  return absent(address.to_string());
}

Result<std::unique_ptr<Publisher>> make_publisher(const Address& address) {
  return absent(address.to_string());
}

}  // namespace geoflow::drivers::dds

namespace geoflow::drivers {

Result<std::unique_ptr<RosPublisher>> RosPublisher::open(const RosPublisherOptions& /*options*/) {
  return dds::absent("ros");
}

}  // namespace geoflow::drivers
