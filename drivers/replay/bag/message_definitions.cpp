#include "replay/bag/message_definitions.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace geoflow::drivers::bag {
namespace {

struct Definition {
  std::string_view name;  ///< package/Message
  std::string_view fields;
};

constexpr std::array kDefinitions{
    Definition{"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"},
    Definition{"std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"},
    Definition{"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"},
    Definition{"geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"},
    Definition{"geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"},
    Definition{"geometry_msgs/Pose",
               "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"},
    Definition{"geometry_msgs/PoseWithCovariance",
               "geometry_msgs/Pose pose\nfloat64[36] covariance\n"},
    Definition{"geometry_msgs/Twist",
               "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"},
    Definition{"geometry_msgs/TwistWithCovariance",
               "geometry_msgs/Twist twist\nfloat64[36] covariance\n"},
    Definition{"geometry_msgs/Transform",
               "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
    Definition{
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
    Definition{"sensor_msgs/RegionOfInterest",
               "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"},
    Definition{"sensor_msgs/Image",
               "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\n"
               "uint8 is_bigendian\nuint32 step\nuint8[] data\n"},
    Definition{"sensor_msgs/CameraInfo",
               "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\n"
               "float64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\nuint32 binning_x\n"
               "uint32 binning_y\nsensor_msgs/RegionOfInterest roi\n"},
    Definition{"sensor_msgs/Imu",
               "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n"
               "float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n"
               "float64[9] angular_velocity_covariance\n"
               "geometry_msgs/Vector3 linear_acceleration\n"
               "float64[9] linear_acceleration_covariance\n"},
    Definition{"sensor_msgs/JointState",
               "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
               "float64[] effort\n"},
    Definition{"nav_msgs/Odometry",
               "std_msgs/Header header\nstring child_frame_id\n"
               "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n"},
    Definition{"tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"},
};

const Definition* find(std::string_view name) {
  const auto* const found = std::ranges::find(kDefinitions, name, &Definition::name);
  return found == kDefinitions.end() ? nullptr : found;
}

/// The messages that a definition's fields have, in their order.
std::vector<std::string_view> members(std::string_view fields) {
  std::vector<std::string_view> names;
  while (!fields.empty()) {
    const std::string_view type = fields.substr(0, fields.find_first_of(" ["));
    if (type.find('/') != std::string_view::npos) {
      names.push_back(type);
    }
    fields.remove_prefix(fields.find('\n') + 1);
  }
  return names;
}

/// Adds the names of all that a message is made of, each once.
void collect(std::string_view fields, std::vector<const Definition*>& parts) {
  for (const std::string_view name : members(fields)) {
    const Definition* part = find(name);
    if (part != nullptr && std::ranges::find(parts, part) == parts.end()) {
      parts.push_back(part);
      collect(part->fields, parts);
    }
  }
}

}  // namespace

std::string message_definition(std::string_view type) {
  constexpr std::string_view kMiddle = "/msg/";
  constexpr std::size_t kRuleLength = 80;
  const std::size_t middle = type.find(kMiddle);
  if (middle == std::string_view::npos) {
    return {};
  }
  const std::string name =
      std::string{type.substr(0, middle)} + "/" + std::string{type.substr(middle + kMiddle.size())};
  const Definition* definition = find(name);
  if (definition == nullptr) {
    return {};
  }
  std::vector<const Definition*> parts;
  collect(definition->fields, parts);
  std::string text{definition->fields};
  for (const Definition* part : parts) {
    text += std::string(kRuleLength, '=') + "\nMSG: ";
    text += part->name;
    text += "\n";
    text += part->fields;
  }
  return text;
}

}  // namespace geoflow::drivers::bag
