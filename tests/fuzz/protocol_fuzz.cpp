#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string_view>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/daemon/records.hpp"

#include "protocol/control_request.hpp"

/// Both sockets' parsers on any bytes: a datagram for the pose socket, a line for the control
/// socket.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace geoflow::daemon;
  const auto bytes = std::as_bytes(std::span{data, size});
  if (const auto record = parse_record(bytes)) {
    if (record->payload.size() + sizeof(geoflow_header) != size) {
      std::abort();
    }
    (void)pose_to_json(read_payload<geoflow_pose>(record->payload)).dump();
  }
  if (const auto hello = parse_hello(bytes)) {
    if (!(hello->max_rate_hz >= 0.0) || hello->name.size() > sizeof geoflow_hello{}.name) {
      std::abort();
    }
  }
  const void* generic = data;
  const auto request = parse_control_request({static_cast<const char*>(generic), size});
  return request && size > kLongestRequest ? (std::abort(), 0) : 0;
}
