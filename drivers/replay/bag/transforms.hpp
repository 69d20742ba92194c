#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "geoflow/hal/geometry.hpp"

#include "replay/cdr/messages.hpp"

namespace geoflow::drivers::bag {

/// The fixed transforms of /tf_static, and the way between any two frames that they connect.
/// Thread-compatible.
class StaticTransforms {
 public:
  /// A later transform between the same two frames replaces an earlier one. One that is not rigid,
  /// and any beyond the ten thousandth, is passed over.
  void add(const ros::TransformStamped& transform);

  /// T_a_b, or none where nothing connects the frames. A leading slash of a frame's name does not
  /// count.
  [[nodiscard]] std::optional<SE3> find(const std::string& a, const std::string& b) const;

 private:
  using Edges = std::map<std::string, SE3>;  ///< T_frame_neighbour by neighbour
  std::map<std::string, Edges> frames_;
  std::size_t count_ = 0;
};

}  // namespace geoflow::drivers::bag
