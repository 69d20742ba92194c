#include "replay/openloris/calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/calibration/yaml.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::openloris {
namespace {

using yaml::Entry;

constexpr std::string_view kColorFrame = "d400_color_optical_frame";
constexpr std::string_view kImuFrame = "d400_accelerometer";
constexpr std::string_view kBaseFrame = "base_link";
constexpr double kDepthUnitM = 1e-3;
constexpr double kLargestSide = 65535;

/// T_parent_child.
struct Edge {
  std::string parent;
  std::string child;
  SE3 T_parent_child;
};

/// The numbers of an `!!opencv-matrix`.
Result<std::vector<double>> matrix_data(const Entry& matrix, std::span<const std::size_t> sizes) {
  Result<std::vector<double>> values = tl::unexpected{matrix.error("data is missing")};
  auto read = yaml::for_each(matrix, [&](const Entry& entry, std::string_view key) -> Result<void> {
    if (key != "data") {
      return {};
    }
    values = yaml::numbers(entry, sizes);
    return values ? Result<void>{} : tl::unexpected{values.error()};
  });
  return read ? values : tl::unexpected{std::move(read.error())};
}

Result<void> read_intrinsics(const Entry& entry, CameraIntrinsics& camera) {
  constexpr std::array<std::size_t, 1> kSizes = {4};
  const auto values = matrix_data(entry, kSizes);
  if (!values) {
    return tl::unexpected{values.error()};
  }
  camera.fx = (*values)[0];
  camera.cx = (*values)[1];
  camera.fy = (*values)[2];
  camera.cy = (*values)[3];
  if (camera.fx <= 0 || camera.fy <= 0) {
    return tl::unexpected{entry.error("focal lengths must be positive")};
  }
  return {};
}

Result<void> read_side(const Entry& entry, int& side) {
  const auto value = yaml::positive(entry);
  if (!value) {
    return tl::unexpected{value.error()};
  }
  if (*value > kLargestSide || std::floor(*value) != *value) {
    return tl::unexpected{entry.error("a whole number from 1 to 65535 is expected")};
  }
  side = static_cast<int>(*value);
  return {};
}

Result<void> read_distortion(const Entry& entry, CameraIntrinsics& camera) {
  constexpr std::array<std::size_t, 2> kSizes = {4, 5};
  const auto values = matrix_data(entry, kSizes);
  if (!values) {
    return tl::unexpected{values.error()};
  }
  std::ranges::copy(*values, camera.distortion.begin());
  const bool straight = std::ranges::all_of(*values, [](double value) { return value == 0; });
  camera.model = straight ? DistortionModel::kNone : DistortionModel::kRadtan;
  return {};
}

Result<void> read_camera(const Entry& entry, CameraIntrinsics& camera) {
  return yaml::for_each(entry, [&](const Entry& value, std::string_view key) -> Result<void> {
    if (key == "width") {
      return read_side(value, camera.width);
    }
    if (key == "height") {
      return read_side(value, camera.height);
    }
    if (key == "intrinsics") {
      return read_intrinsics(value, camera);
    }
    if (key == "distortion_coefficients") {
      return read_distortion(value, camera);
    }
    if (key == "distortion_model") {
      const auto name = yaml::text(value);
      if (!name || (*name != "radial-tangential" && *name != "none")) {
        return tl::unexpected{value.error("only radial-tangential is supported")};
      }
    }
    return {};  // rates, names and the like
  });
}

Result<Edge> read_edge(const Entry& entry) {
  Edge edge;
  bool has_matrix = false;
  auto read = yaml::for_each(entry, [&](const Entry& value, std::string_view key) -> Result<void> {
    if (key == "parent_frame" || key == "child_frame") {
      auto name = yaml::text(value);
      if (!name) {
        return tl::unexpected{std::move(name.error())};
      }
      (key == "parent_frame" ? edge.parent : edge.child) = *std::move(name);
    } else if (key == "matrix") {
      constexpr std::array<std::size_t, 1> kSizes = {16};
      const auto values = matrix_data(value, kSizes);
      const auto transform =
          values ? yaml::transform_of_rows(value, *values) : tl::unexpected{values.error()};
      if (!transform) {
        return tl::unexpected{transform.error()};
      }
      edge.T_parent_child = *transform;
      has_matrix = true;
    }
    return {};
  });
  if (!read) {
    return tl::unexpected{std::move(read.error())};
  }
  if (edge.parent.empty() || edge.child.empty() || !has_matrix) {
    return tl::unexpected{entry.error("parent_frame, child_frame and matrix are expected")};
  }
  return edge;
}

/// T_from_to along the fewest edges; none where they are not connected.
std::optional<SE3> chain(const std::vector<Edge>& edges, std::string_view from,
                         std::string_view to) {
  std::map<std::string_view, SE3> T_from_known = {{from, SE3{}}};
  std::deque<std::string_view> open = {from};
  while (!open.empty() && !T_from_known.contains(to)) {
    const std::string_view frame = open.front();
    open.pop_front();
    const SE3 T_from_frame = T_from_known.at(frame);
    for (const Edge& edge : edges) {
      const bool down = edge.parent == frame;
      const std::string_view next = down ? edge.child : edge.parent;
      if ((down || edge.child == frame) && !T_from_known.contains(next)) {
        const SE3 T_frame_next = down ? edge.T_parent_child : edge.T_parent_child.inverse();
        T_from_known.emplace(next, T_from_frame * T_frame_next);
        open.push_back(next);
      }
    }
  }
  const auto found = T_from_known.find(to);
  return found == T_from_known.end() ? std::nullopt : std::optional{found->second};
}

}  // namespace

Result<FoundCalibration> parse_sensors(std::string_view file, std::string content) {
  const auto top = yaml::parse(file, std::move(content));
  if (!top) {
    return tl::unexpected{top.error()};
  }
  CameraIntrinsics camera;
  auto read = yaml::for_each(*top, [&](const Entry& entry, std::string_view key) {
    return key == kColorFrame ? read_camera(entry, camera) : Result<void>{};
  });
  if (!read) {
    return tl::unexpected{std::move(read.error())};
  }
  if (camera.fx == 0 || camera.width == 0 || camera.height == 0) {
    return tl::unexpected{
        top->error(std::string{kColorFrame} + ": width, height and intrinsics are expected")};
  }
  FoundCalibration found;
  found.camera = camera;
  found.depth_unit_m = kDepthUnitM;
  found.depth_alignment = DepthAlignment::kNearestTouching;  // a D435i's, aligned by realsense-ros
  found.source = file;
  return found;
}

Result<void> parse_transforms(std::string_view file, std::string content, FoundCalibration& found) {
  const auto top = yaml::parse(file, std::move(content));
  if (!top) {
    return tl::unexpected{top.error()};
  }
  std::vector<Edge> edges;
  auto read = yaml::for_each(*top, [&](const Entry& entry, std::string_view key) -> Result<void> {
    if (key != "trans_matrix") {
      return {};
    }
    if (!entry.node.IsSequence()) {
      return tl::unexpected{entry.error("a list is expected")};
    }
    for (const auto& item : entry.node) {
      const YAML::Node& node = item;
      auto edge = read_edge(Entry{.file = entry.file, .key = entry.key, .node = node});
      if (!edge) {
        return tl::unexpected{std::move(edge.error())};
      }
      edges.push_back(*std::move(edge));
    }
    return {};
  });
  found.T_base_cam = chain(edges, kBaseFrame, kColorFrame);
  found.T_cam_imu = chain(edges, kColorFrame, kImuFrame);
  return read;
}

}  // namespace geoflow::drivers::openloris
