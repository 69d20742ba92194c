#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <vector>

#include "geoflow/hal/calibration.hpp"

#include "cloud/cell_grid.hpp"
#include "cloud/depth_cloud.hpp"
#include "map/ids.hpp"
#include "map/map.hpp"
#include "storage/bytes.hpp"
#include "vision/place_view.hpp"

/// What the sections of a map file hold, as bytes and back: docs/map-file.md. Decoders say what is
/// wrong by ByteReader::wrong(); what they return then means nothing. Pure.
namespace geoflow::slam {

/// What made a map.
struct MapIdentity {
  std::string made_by;  ///< version of the program
  Calibration calibration;
};

[[nodiscard]] std::vector<std::byte> encode(const MapIdentity& identity);
[[nodiscard]] MapIdentity decode_identity(ByteReader& reader);

/// Without place, depth and image.
[[nodiscard]] std::vector<std::byte> encode(const std::map<KeyframeId, Keyframe>& keyframes);
[[nodiscard]] std::map<KeyframeId, Keyframe> decode_keyframes(ByteReader& reader);

[[nodiscard]] std::vector<std::byte> encode(const std::map<PointId, MapPoint>& points);
/// Of these keyframes; who observes what must be the same on both sides.
[[nodiscard]] std::map<PointId, MapPoint> decode_points(
    ByteReader& reader, const std::map<KeyframeId, Keyframe>& keyframes);

[[nodiscard]] std::vector<std::byte> encode(const std::vector<RelativeEdge>& edges);
[[nodiscard]] std::vector<RelativeEdge> decode_edges(
    ByteReader& reader, const std::map<KeyframeId, Keyframe>& keyframes);

[[nodiscard]] std::vector<std::byte> encode(const PlaceView& place);
[[nodiscard]] std::shared_ptr<const PlaceView> decode_place(ByteReader& reader);

[[nodiscard]] std::vector<std::byte> encode(const DepthCloud& cloud);
/// Null where something is wrong.
[[nodiscard]] std::shared_ptr<const DepthCloud> decode_cloud(ByteReader& reader,
                                                             std::shared_ptr<const CellGrid> grid);

}  // namespace geoflow::slam
