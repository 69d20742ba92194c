#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

#include "cloud/depth_cloud.hpp"
#include "inertial/gyro_turn.hpp"
#include "inertial/up_direction.hpp"
#include "map/ids.hpp"
#include "map/stored_cloud.hpp"
#include "place/place_index.hpp"
#include "vision/orb_features.hpp"
#include "vision/row_time.hpp"

/// What has been seen, and from where. Value types, thread-compatible; odom is the map's frame.
namespace geoflow::slam {

class ImagePyramid;
struct PlaceView;

/// One keyframe's view of one map point.
struct Observation {
  KeyframeId keyframe;
  Vector2d pixel;      ///< ideal [px]
  double depth_m = 0;  ///< measured z in the camera frame [m]; 0 where the camera gave none
};

/// A point of the scene with the first descriptor it was seen with.
struct MapPoint {
  Vector3d p_odom = Vector3d::Zero();
  Descriptor descriptor{};
  std::vector<Observation> observations;  ///< in order of keyframe
  std::uint32_t expected = 0;             ///< frames whose pose says that it is in view
  std::uint32_t found = 0;                ///< of those, frames in which it agreed with the pose
};

/// Whether an edge ties neighbours on one way, a place to itself as it was seen again, or a
/// keyframe to the one before by IMU and legs.
enum class EdgeKind : std::uint8_t { kWay, kLoop, kReckoned };

/// The relative pose of two keyframes: from their depth, a GICP factor (paper, equation (5)); from
/// IMU and legs in between; or from both views, where a loop closes.
struct RelativeEdge {
  KeyframeId from{};
  KeyframeId to{};
  SE3 T_from_to;
  Matrix6d information = Matrix6d::Zero();  ///< of a right perturbation of T_from_to
  EdgeKind kind = EdgeKind::kWay;
};

/// A frame that was kept.
struct Keyframe {
  HostTime t;
  PartId part{};
  SE3 T_odom_cam;
  Matrix6d covariance = Matrix6d::Zero();   ///< of T_odom_cam
  std::shared_ptr<const DepthCloud> cloud;  ///< null where the frame had no depth or it was let go
  std::shared_ptr<const StoredCloud> stored_cloud{};  ///< the same in a file; null: in none
  std::shared_ptr<const PlaceView> place;             ///< null until describe() gives it
  std::shared_ptr<const ImagePyramid> pyramid;        ///< null where it was let go
  RowMotion rows{};                                   ///< while the pyramid's image was read out
  /// What legs and IMU say of the motion since the keyframe before; none: not all the way, or of
  /// another run.
  std::optional<RelativeEdge> reckoned{};
  GyroTurn gyro{};                  ///< in the edge of kind kReckoned to it; none of another run
  std::optional<UpDirection> up{};  ///< in the camera's frame; none of another run
  std::vector<PointId> points;      ///< that it observes
};

/// All that a map is made of. Copies share what is heavy: a snapshot costs little.
struct MapContents {
  std::map<KeyframeId, Keyframe> keyframes;
  std::map<PointId, MapPoint> points;
  std::vector<RelativeEdge> edges;
  /// What tied a part to another one, from the keyframe that is older: each is the one tie of two
  /// threads of odometry, and as good as odometry.
  std::vector<RelativeEdge> joins;
};

/// Keyframes, points and the edges between keyframes. Iterates in order of id, so that the same
/// input gives the same map.
class Map {
 public:
  Map() = default;
  /// A map that was kept; new keyframes begin a part of their own. Contents are consistent:
  /// whatever is referred to is there.
  explicit Map(MapContents contents);

  /// Adds a keyframe to the newest part.
  KeyframeId add_keyframe(Keyframe keyframe);
  /// Keyframes from now on belong to a part that nothing ties to the others.
  void begin_part();
  /// Ties two parts by a place seen in both: the one of `tie.to` gets the coordinates and the id of
  /// that of `tie.from`. Returns T_odom1_odom0 of what was moved. The parts must differ.
  SE3 join(const RelativeEdge& tie);
  /// Gives a keyframe that has none its place, and files it in places().
  void describe(KeyframeId id, std::shared_ptr<const PlaceView> place);
  PointId add_point(MapPoint point);
  /// Records that a keyframe sees a point (once per pair).
  void observe(PointId point, const Observation& observation);
  void add_edge(const RelativeEdge& edge) { contents_.edges.push_back(edge); }
  /// Forgets all edges between two keyframes, in this direction.
  void remove_edges(KeyframeId from, KeyframeId to);
  /// Forgets a point and all its observations.
  void remove_point(PointId id);
  /// Forgets one observation; a point left with none goes too.
  void remove_observation(PointId id, KeyframeId keyframe);
  /// Moves every keyframe by `T_odom1_odom0(id)`, applied on the left, and every point with the
  /// keyframe that saw it first.
  void move(const std::function<SE3(KeyframeId)>& T_odom1_odom0);
  /// Lets go of the depth and the images of all but so many newest keyframes: what bounds the
  /// memory.
  void keep_newest(std::size_t clouds, std::size_t pyramids);
  /// Reads the depth of keyframes within `radius_m` of a keyframe, in its part, that lies in a
  /// file, nearest first and at most `most`. What cannot be read is not asked for again.
  void read_clouds_near(KeyframeId id, double radius_m, std::size_t most);

  [[nodiscard]] const MapContents& contents() const noexcept { return contents_; }
  [[nodiscard]] const std::map<KeyframeId, Keyframe>& keyframes() const noexcept {
    return contents_.keyframes;
  }
  [[nodiscard]] const std::map<PointId, MapPoint>& points() const noexcept {
    return contents_.points;
  }
  [[nodiscard]] const std::vector<RelativeEdge>& edges() const noexcept { return contents_.edges; }
  [[nodiscard]] const std::vector<RelativeEdge>& joins() const noexcept { return contents_.joins; }
  /// The part to which new keyframes belong.
  [[nodiscard]] PartId newest_part() const noexcept { return newest_part_; }
  /// Whether the newest part is the only one or has been joined to an older one.
  [[nodiscard]] bool is_tied() const;
  [[nodiscard]] bool same_part(KeyframeId a, KeyframeId b) const {
    return keyframe(a).part == keyframe(b).part;
  }
  /// Whether no odometry leads to a keyframe from the one before, or there is none before.
  [[nodiscard]] bool begins_thread(KeyframeId id) const {
    return !contents_.keyframes.contains(KeyframeId{static_cast<std::uint32_t>(id) - 1});
  }
  /// By what they look like: the keyframes that have their place.
  [[nodiscard]] const PlaceIndex& places() const noexcept { return places_; }
  [[nodiscard]] Keyframe& keyframe(KeyframeId id) { return contents_.keyframes.at(id); }
  [[nodiscard]] const Keyframe& keyframe(KeyframeId id) const { return contents_.keyframes.at(id); }
  /// Null where the point is no more.
  [[nodiscard]] MapPoint* find_point(PointId id);
  [[nodiscard]] const MapPoint* find_point(PointId id) const;

 private:
  MapContents contents_;
  PlaceIndex places_;
  PartId newest_part_{};
  std::uint32_t next_part_ = 1;
  std::uint32_t next_keyframe_ = 0;
  std::uint32_t next_point_ = 0;
};

}  // namespace geoflow::slam
