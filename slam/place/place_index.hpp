#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "map/ids.hpp"
#include "vision/orb_features.hpp"

namespace geoflow::slam {

struct PlaceView;

/// A keyframe whose view may show the place that was asked for.
struct PlaceCandidate {
  KeyframeId keyframe;
  double score;  ///< share of the view's features found in it, rare ones counting more, 0 to 1
};

/// Where a view has been seen before: an inverted index of keyframes' binary descriptors that grows
/// with the map and needs no vocabulary.
///
/// Each descriptor is filed in several hash tables (locality-sensitive hashing by bit sampling:
/// Indyk and Motwani, "Approximate nearest neighbors", STOC 1998) under some of its bits, together
/// with some others, its signature. A descriptor of a query meets those that have all bits of a
/// table's key in common with it and nearly all of that table's signature. It votes once for each
/// keyframe that it meets, with the weight of its rarity among keyframes (inverse document
/// frequency: Sivic and Zisserman, "Video Google", ICCV 2003). Bits are taken from the front of the
/// descriptor: ORB's comparisons are sorted by their spread, and little correlated (Rublee et al.,
/// ICCV 2011, section 4.3).
///
/// About 14 bytes a descriptor, and 1.2 MB for the tables. Deterministic. Thread-compatible.
class PlaceIndex {
 public:
  PlaceIndex();

  /// Files a keyframe that is not there yet. False, and nothing is filed, when kMostKeyframes are.
  bool add(KeyframeId keyframe, const PlaceView& view);

  /// Takes out a keyframe, given the view that it was added with; one that is not there is ignored.
  void remove(KeyframeId keyframe, const PlaceView& view);

  [[nodiscard]] bool contains(KeyframeId keyframe) const { return slots_.contains(keyframe); }
  [[nodiscard]] std::size_t size() const noexcept { return slots_.size(); }

  /// The keyframes that have anything in common with the view, best first, at most `most`; equally
  /// good ones by age. Neighbours in time see the same and so stand together: see peaks().
  [[nodiscard]] std::vector<PlaceCandidate> query(const PlaceView& view, std::size_t most) const;

  /// Bytes of the tables.
  [[nodiscard]] std::size_t memory_bytes() const noexcept;

  /// Keyframes that can be filed at once.
  static constexpr std::size_t kMostKeyframes = 1U << 16U;

 private:
  static constexpr std::size_t kTables = 3;
  static constexpr std::size_t kKeyBits = 14;
  static constexpr std::size_t kSignatureBits = 16;
  static constexpr std::size_t kBuckets = 1U << kKeyBits;

  /// A keyframe's slot in the upper half, a descriptor's signature in the lower.
  using Posting = std::uint32_t;
  struct Hash {
    std::uint32_t key;
    std::uint32_t signature;
  };
  using Slot = std::uint32_t;
  class Votes;

  [[nodiscard]] static Hash hash(const Descriptor& descriptor, std::size_t table) noexcept;
  [[nodiscard]] std::vector<Posting>& bucket(std::size_t table, std::uint32_t key) {
    return buckets_[table * kBuckets + key];
  }
  /// The keyframes in a bucket whose descriptors have nearly this signature.
  static void collect(std::span<const Posting> bucket, std::uint32_t signature, Votes& votes);

  std::vector<std::vector<Posting>> buckets_;  ///< of all tables
  Slot slots_made_ = 0;
  std::vector<Slot> free_slots_;
  std::map<KeyframeId, Slot> slots_;
};

/// Of a ranking, the first `most` that are not within `apart` ids of a better one: one for each
/// stretch of keyframes that saw the place.
[[nodiscard]] std::vector<PlaceCandidate> peaks(const std::vector<PlaceCandidate>& ranking,
                                                std::size_t most, std::uint32_t apart);

}  // namespace geoflow::slam
