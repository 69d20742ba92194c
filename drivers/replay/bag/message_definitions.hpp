#pragma once

#include <string>
#include <string_view>

namespace geoflow::drivers::bag {

/// What a message of this type (`sensor_msgs/msg/Imu`) is made of, in the form that MCAP calls
/// `ros2msg`: the fields of its .msg file, then those of every message in it, each after a line of
/// 80 `=` and one that names it (mcap.dev/spec/registry). Empty for a type that this project does
/// not write. Fields as in replay/cdr/messages.hpp. Pure.
[[nodiscard]] std::string message_definition(std::string_view type);

}  // namespace geoflow::drivers::bag
