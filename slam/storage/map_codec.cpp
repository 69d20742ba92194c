#include "storage/map_codec.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/time.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "storage/bytes.hpp"
#include "vision/orb_features.hpp"
#include "vision/place_view.hpp"

namespace geoflow::slam {
namespace {

/// Bytes of the entries of lists, without their own lists.
constexpr std::size_t kPoseBytes = 7 * sizeof(double);
constexpr std::size_t kMatrixBytes = 36 * sizeof(double);
constexpr std::size_t kKeyframeBytes = 20 + kPoseBytes + kMatrixBytes;
constexpr std::size_t kPointBytes = 3 * sizeof(double) + sizeof(Descriptor) + 16;
constexpr std::size_t kObservationBytes = 4 + 3 * sizeof(double);
constexpr std::size_t kEdgeBytes = 12 + kPoseBytes + kMatrixBytes;
constexpr std::size_t kFeatureBytes = 5 * sizeof(double) + sizeof(Descriptor);
constexpr std::size_t kSurfelBytes = 4 + 8 * sizeof(float);

/// Greatest id: there has to be room for those of keyframes to come.
constexpr std::uint32_t kGreatestId = 1U << 31U;

/// What comes in order of strictly ascending ids.
template <typename Id>
class Ascending {
 public:
  [[nodiscard]] Id next(ByteReader& reader) {
    const std::uint32_t id = reader.u32();
    if (id < least_ || id >= kGreatestId) {
      reader.fail("ids do not ascend");
    }
    least_ = id + 1;
    return Id{id};
  }

 private:
  std::uint32_t least_ = 0;
};

KeyframeId keyframe_id(ByteReader& reader, const std::map<KeyframeId, Keyframe>& keyframes) {
  const KeyframeId id{reader.u32()};
  if (!keyframes.contains(id)) {
    reader.fail("a keyframe is meant that is not there");
  }
  return id;
}

void put(ByteWriter& writer, const Descriptor& descriptor) {
  for (const std::uint64_t word : descriptor) {
    writer.put(word);
  }
}

Descriptor descriptor(ByteReader& reader) {
  Descriptor descriptor{};
  for (std::uint64_t& word : descriptor) {
    word = reader.get<std::uint64_t>();
  }
  return descriptor;
}

Eigen::Vector3f vector3f(ByteReader& reader) {
  const float x = reader.f32();
  const float y = reader.f32();
  return {x, y, reader.f32()};
}

/// Covariances and informations: no negative variance.
Matrix6d positive(ByteReader& reader) {
  Matrix6d matrix = reader.matrix6();
  if (matrix.diagonal().minCoeff() < 0) {
    reader.fail("a variance is negative");
  }
  return matrix;
}

template <typename Enum>
Enum one_of(ByteReader& reader, Enum last) {
  const std::uint32_t value = reader.u32();
  if (value > static_cast<std::uint32_t>(last)) {
    reader.fail("a value is not one of its kind");
    return Enum{};
  }
  return static_cast<Enum>(value);
}

void put(ByteWriter& writer, const CameraIntrinsics& camera) {
  writer.put(static_cast<std::uint32_t>(camera.width));
  writer.put(static_cast<std::uint32_t>(camera.height));
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) {
    writer.put(value);
  }
  writer.put(static_cast<std::uint32_t>(camera.model));
  for (const double value : camera.distortion) {
    writer.put(value);
  }
}

CameraIntrinsics camera(ByteReader& reader) {
  constexpr std::uint32_t kLargestPx = 1U << 14U;
  CameraIntrinsics camera;
  for (int* side : {&camera.width, &camera.height}) {
    const std::uint32_t px = reader.u32();
    if (px > kLargestPx) {
      reader.fail("an image is larger than any");
    }
    *side = static_cast<int>(std::min(px, kLargestPx));
  }
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) {
    *value = reader.f64();
  }
  camera.model = one_of(reader, DistortionModel::kEquidistant);
  for (double& value : camera.distortion) {
    value = reader.f64();
  }
  return camera;
}

MapPoint decode_point(ByteReader& reader, const std::map<KeyframeId, Keyframe>& keyframes) {
  MapPoint point;
  point.p_odom = reader.vector3();
  point.descriptor = descriptor(reader);
  point.expected = reader.u32();
  point.found = reader.u32();
  std::size_t n = reader.count(kObservationBytes);
  if (n == 0) {
    reader.fail("a point that nothing observes");
  }
  for (; n > 0 && reader.ok(); --n) {
    Observation observation{.keyframe = keyframe_id(reader, keyframes), .pixel = reader.vector2()};
    observation.depth_m = reader.f64();
    point.observations.push_back(observation);
  }
  return point;
}

}  // namespace

std::vector<std::byte> encode(const MapIdentity& identity) {
  ByteWriter writer;
  const Calibration& calibration = identity.calibration;
  writer.put(std::string_view{identity.made_by});
  put(writer, calibration.camera);
  writer.put(calibration.depth_unit_m);
  writer.put(static_cast<std::uint32_t>(calibration.depth_alignment));
  writer.put(static_cast<std::uint32_t>(calibration.T_base_cam ? 1 : 0));
  writer.put(calibration.T_base_cam.value_or(SE3{}));
  writer.put(std::string_view{calibration.source});
  writer.put(std::string_view{calibration.serial});
  return writer.take();
}

MapIdentity decode_identity(ByteReader& reader) {
  MapIdentity identity;
  Calibration& calibration = identity.calibration;
  identity.made_by = reader.text();
  calibration.camera = camera(reader);
  calibration.depth_unit_m = reader.f64();
  calibration.depth_alignment = one_of(reader, DepthAlignment::kNearestTouching);
  const bool on_robot = reader.u32() != 0;
  const SE3 T_base_cam = reader.pose();
  if (on_robot) {
    calibration.T_base_cam = T_base_cam;
  }
  calibration.source = reader.text();
  calibration.serial = reader.text();
  return identity;
}

std::vector<std::byte> encode(const std::map<KeyframeId, Keyframe>& keyframes) {
  ByteWriter writer;
  writer.put_count(keyframes.size());
  for (const auto& [id, keyframe] : keyframes) {
    writer.put(static_cast<std::uint32_t>(id));
    writer.put(static_cast<std::uint32_t>(keyframe.part));
    writer.put(static_cast<std::uint64_t>(keyframe.t.time_since_epoch().count()));
    writer.put(keyframe.T_odom_cam);
    writer.put(keyframe.covariance);
    writer.put_count(keyframe.points.size());
    for (const PointId point : keyframe.points) {
      writer.put(static_cast<std::uint32_t>(point));
    }
  }
  return writer.take();
}

std::map<KeyframeId, Keyframe> decode_keyframes(ByteReader& reader) {
  std::map<KeyframeId, Keyframe> keyframes;
  Ascending<KeyframeId> ids;
  for (std::size_t n = reader.count(kKeyframeBytes); n > 0 && reader.ok(); --n) {
    const KeyframeId id = ids.next(reader);
    Keyframe keyframe;
    keyframe.part = PartId{reader.u32()};
    if (static_cast<std::uint32_t>(keyframe.part) >= kGreatestId) {
      reader.fail("a part's id is out of range");
    }
    keyframe.t = HostTime{Duration{static_cast<std::int64_t>(reader.get<std::uint64_t>())}};
    keyframe.T_odom_cam = reader.pose();
    keyframe.covariance = positive(reader);
    for (std::size_t points = reader.count(sizeof(PointId)); points > 0; --points) {
      keyframe.points.push_back(PointId{reader.u32()});
    }
    keyframes.emplace(id, std::move(keyframe));
  }
  return keyframes;
}

std::vector<std::byte> encode(const std::map<PointId, MapPoint>& points) {
  ByteWriter writer;
  writer.put_count(points.size());
  for (const auto& [id, point] : points) {
    writer.put(static_cast<std::uint32_t>(id));
    writer.put(point.p_odom);
    put(writer, point.descriptor);
    writer.put(point.expected);
    writer.put(point.found);
    writer.put_count(point.observations.size());
    for (const Observation& observation : point.observations) {
      writer.put(static_cast<std::uint32_t>(observation.keyframe));
      writer.put(observation.pixel);
      writer.put(observation.depth_m);
    }
  }
  return writer.take();
}

std::map<PointId, MapPoint> decode_points(ByteReader& reader,
                                          const std::map<KeyframeId, Keyframe>& keyframes) {
  std::map<PointId, MapPoint> points;
  std::set<std::pair<KeyframeId, PointId>> observed;
  Ascending<PointId> ids;
  for (std::size_t n = reader.count(kPointBytes); n > 0 && reader.ok(); --n) {
    const PointId id = ids.next(reader);
    const MapPoint& point = points.emplace(id, decode_point(reader, keyframes)).first->second;
    for (const Observation& observation : point.observations) {
      if (!observed.emplace(observation.keyframe, id).second) {
        reader.fail("a keyframe observes a point twice");
      }
    }
  }
  for (const auto& [id, keyframe] : keyframes) {
    for (const PointId point : keyframe.points) {
      if (observed.erase({id, point}) == 0) {
        reader.fail("a keyframe sees a point that does not know of it, or twice");
      }
    }
  }
  if (!observed.empty()) {
    reader.fail("a point is observed by a keyframe that does not know of it");
  }
  return points;
}

std::vector<std::byte> encode(const std::vector<RelativeEdge>& edges) {
  ByteWriter writer;
  writer.put_count(edges.size());
  for (const RelativeEdge& edge : edges) {
    writer.put(static_cast<std::uint32_t>(edge.from));
    writer.put(static_cast<std::uint32_t>(edge.to));
    writer.put(edge.T_from_to);
    writer.put(edge.information);
    // Of an edge that was reckoned the gyroscope's share is not kept: it is as any other then.
    const EdgeKind kind = edge.kind == EdgeKind::kReckoned ? EdgeKind::kWay : edge.kind;
    writer.put(static_cast<std::uint32_t>(kind));
  }
  return writer.take();
}

std::vector<RelativeEdge> decode_edges(ByteReader& reader,
                                       const std::map<KeyframeId, Keyframe>& keyframes) {
  std::vector<RelativeEdge> edges;
  for (std::size_t n = reader.count(kEdgeBytes); n > 0 && reader.ok(); --n) {
    RelativeEdge edge;
    edge.from = keyframe_id(reader, keyframes);
    edge.to = keyframe_id(reader, keyframes);
    edge.T_from_to = reader.pose();
    edge.information = positive(reader);
    edge.kind = one_of(reader, EdgeKind::kLoop);
    if (edge.from == edge.to ||
        (reader.ok() && keyframes.at(edge.from).part != keyframes.at(edge.to).part)) {
      reader.fail("an edge between keyframes that it cannot tie");
    }
    edges.push_back(edge);
  }
  return edges;
}

std::vector<std::byte> encode(const PlaceView& place) {
  ByteWriter writer;
  writer.put_count(place.features.size());
  for (std::size_t i = 0; i < place.features.size(); ++i) {
    writer.put(place.features[i].pixel);
    put(writer, place.features[i].descriptor);
    writer.put(place.p_cam[i]);
  }
  return writer.take();
}

std::shared_ptr<const PlaceView> decode_place(ByteReader& reader) {
  auto place = std::make_shared<PlaceView>();
  for (std::size_t n = reader.count(kFeatureBytes); n > 0; --n) {
    const Vector2d pixel = reader.vector2();
    place->features.push_back({.pixel = pixel, .descriptor = descriptor(reader)});
    place->p_cam.push_back(reader.vector3());
  }
  return place;
}

std::vector<std::byte> encode(const DepthCloud& cloud) {
  ByteWriter writer;
  writer.put(cloud.pixels().unit_m);
  writer.put(static_cast<std::uint32_t>(cloud.pixels().alignment));
  writer.put(cloud.sigma());
  writer.put(static_cast<std::uint32_t>(cloud.grid().columns()));
  writer.put(static_cast<std::uint32_t>(cloud.grid().rows()));
  writer.put_count(cloud.size());
  for (const std::uint32_t cell : cloud.valid()) {
    const Surfel& surfel = cloud.surfels()[cell];
    writer.put(cell);
    for (const float value :
         {surfel.point.x(), surfel.point.y(), surfel.point.z(), surfel.normal_variance,
          surfel.normal.x(), surfel.normal.y(), surfel.normal.z(), surfel.tilt_variance}) {
      writer.put(value);
    }
  }
  return writer.take();
}

std::shared_ptr<const DepthCloud> decode_cloud(ByteReader& reader,
                                               std::shared_ptr<const CellGrid> grid) {
  DepthCloud::Pixels pixels{.unit_m = reader.f64()};
  pixels.alignment = one_of(reader, DepthAlignment::kNearestTouching);
  const float sigma = reader.f32();
  if (reader.u32() != static_cast<std::uint32_t>(grid->columns()) ||
      reader.u32() != static_cast<std::uint32_t>(grid->rows())) {
    reader.fail("depth in cells that are not this program's");
  }
  std::vector<DepthCloud::Stored> surfels;
  Ascending<std::uint32_t> cells;
  for (std::size_t n = reader.count(kSurfelBytes); n > 0 && reader.ok(); --n) {
    DepthCloud::Stored stored{.cell = cells.next(reader), .surfel = {}};
    stored.surfel.point = vector3f(reader);
    stored.surfel.normal_variance = reader.f32();
    stored.surfel.normal = vector3f(reader);
    stored.surfel.tilt_variance = reader.f32();
    if (stored.cell >= grid->size() || !stored.surfel.valid() || !(stored.surfel.point.z() > 0)) {
      reader.fail("a surfel that is none");
    }
    surfels.push_back(stored);
  }
  return reader.ok() ? DepthCloud::restored(std::move(grid), pixels, sigma, surfels) : nullptr;
}

}  // namespace geoflow::slam
