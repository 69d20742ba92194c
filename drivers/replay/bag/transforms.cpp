#include "replay/bag/transforms.hpp"

#include <cstddef>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "geoflow/hal/geometry.hpp"

#include "replay/bag/samples.hpp"
#include "replay/cdr/messages.hpp"

namespace geoflow::drivers::bag {
namespace {

std::string without_slash(const std::string& frame) {
  return frame.starts_with('/') ? frame.substr(1) : frame;
}

}  // namespace

void StaticTransforms::add(const ros::TransformStamped& transform) {
  constexpr std::size_t kMaxTransforms = 10'000;
  const auto T_parent_child = to_se3(transform.transform);
  if (!T_parent_child || count_ == kMaxTransforms) {
    return;
  }
  ++count_;
  const std::string parent = without_slash(transform.header.frame_id);
  const std::string child = without_slash(transform.child_frame_id);
  frames_[parent].insert_or_assign(child, *T_parent_child);
  frames_[child].insert_or_assign(parent, T_parent_child->inverse());
}

std::optional<SE3> StaticTransforms::find(const std::string& a, const std::string& b) const {
  const std::string start = without_slash(a);
  const std::string goal = without_slash(b);
  std::map<std::string, SE3> T_start_reached{{start, SE3{}}};
  std::deque<std::string> queue{start};
  while (!queue.empty()) {
    const std::string frame = std::move(queue.front());
    queue.pop_front();
    const SE3 T_start_frame = T_start_reached.at(frame);
    if (frame == goal) {
      return std::optional{T_start_frame};
    }
    const auto edges = frames_.find(frame);
    if (edges == frames_.end()) {
      continue;
    }
    for (const auto& [neighbour, T_frame_neighbour] : edges->second) {
      if (T_start_reached.emplace(neighbour, T_start_frame * T_frame_neighbour).second) {
        queue.push_back(neighbour);
      }
    }
  }
  return std::nullopt;
}

}  // namespace geoflow::drivers::bag
