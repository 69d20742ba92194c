#include <algorithm>
#include <array>
#include <string_view>

#include "geoflow/drivers/ros_publisher.hpp"
#include "geoflow/hal/result.hpp"

namespace geoflow::drivers {
namespace {

constexpr std::string_view kDigits = "0123456789";
constexpr std::string_view kWord =
    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_0123456789";

/// Words of letters, digits and underscores that begin with no digit, with slashes between them.
bool is_namespace(std::string_view name) {
  while (true) {
    const std::string_view word = name.substr(0, name.find('/'));
    if (word.empty() || word.find_first_not_of(kWord) != std::string_view::npos ||
        kDigits.find(word.front()) != std::string_view::npos) {
      return false;
    }
    if (word.size() == name.size()) {
      return true;
    }
    name.remove_prefix(word.size() + 1);
  }
}

/// As tf2 wants it: not empty, no slash in front, nothing that cannot be printed.
bool is_frame(std::string_view name) {
  return !name.empty() && name.front() != '/' &&
         std::ranges::all_of(name, [](char c) { return c > ' ' && c <= '~'; });
}

}  // namespace

Result<void> RosPublisher::check(const RosPublisherOptions& options) {
  if (!options.name.empty() && !is_namespace(options.name)) {
    return fail(ErrorCode::kInvalidArgument,
                "ros.name: '{}' is no ROS 2 namespace: letters, digits and underscores, with "
                "slashes between words that begin with no digit",
                options.name);
  }
  struct Frame {
    std::string_view key;
    std::string_view name;
  };
  const std::array frames = {Frame{.key = "map_frame", .name = options.map_frame},
                             Frame{.key = "odom_frame", .name = options.odom_frame},
                             Frame{.key = "base_frame", .name = options.base_frame}};
  for (const Frame& frame : frames) {
    if (!is_frame(frame.name)) {
      return fail(ErrorCode::kInvalidArgument, "ros.{}: '{}' is no name of a frame", frame.key,
                  frame.name);
    }
    if (std::ranges::count(frames, frame.name, &Frame::name) > 1) {
      return fail(ErrorCode::kInvalidArgument, "ros.{}: '{}' is the name of another frame too",
                  frame.key, frame.name);
    }
  }
  return {};
}

}  // namespace geoflow::drivers
