#include "place/place_index.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "map/ids.hpp"
#include "vision/orb_features.hpp"
#include "vision/place_view.hpp"

namespace geoflow::slam {
namespace {

/// Signatures that differ in more bits are of different features. Half of the bits differ by
/// chance.
constexpr std::uint32_t kSignatureDistance = 3;
constexpr std::size_t kWordBits = 64;
constexpr std::uint32_t kSignatureMask = 0xFFFF;
constexpr std::uint32_t kSlotShift = 16;

std::uint32_t bit(const Descriptor& descriptor, std::size_t index) noexcept {
  return static_cast<std::uint32_t>(descriptor[index / kWordBits] >> (index % kWordBits)) & 1U;
}

/// Postings compared in one go.
constexpr std::size_t kAtOnce = 16;

/// In how many bits the lower halves of at most kAtOnce words differ from a signature. By sums
/// within the word (Knuth, TAOCP 7.1.3), which compilers do for several words at once on any
/// processor.
void signature_distances(std::span<const std::uint32_t> words, std::uint32_t signature,
                         std::array<std::uint32_t, kAtOnce>& distances) noexcept {
  constexpr std::uint32_t kPairs = 0x5555;
  constexpr std::uint32_t kFours = 0x3333;
  constexpr std::uint32_t kBytes = 0x0F0F;
  constexpr std::uint32_t kByteBits = 8;
  constexpr std::uint32_t kByte = 0xFF;
  for (std::size_t i = 0; i < words.size(); ++i) {
    std::uint32_t x = (words[i] ^ signature) & kSignatureMask;
    x -= (x >> 1U) & kPairs;
    x = (x & kFours) + ((x >> 2U) & kFours);
    x = (x + (x >> 4U)) & kBytes;
    distances[i] = (x + (x >> kByteBits)) & kByte;
  }
}

/// push_back() that leaves less room unused: there are many vectors.
void push_tightly(std::vector<std::uint32_t>& words, std::uint32_t word) {
  if (words.size() == words.capacity()) {
    words.reserve(words.size() + words.size() / 4 + 4);
  }
  words.push_back(word);
}

}  // namespace

/// Which keyframes one feature meets, and what all features say together.
class PlaceIndex::Votes {
 public:
  explicit Votes(std::size_t slots) : last_voter_(slots, 0), score_(slots, 0) {}

  void begin_feature() {
    ++voter_;
    met_.clear();
  }
  void meet(Slot slot) {
    if (last_voter_[slot] != voter_) {
      last_voter_[slot] = voter_;
      met_.push_back(slot);
    }
  }
  /// `keyframes`: how many there are to meet.
  void end_feature(double keyframes) {
    const double weight = std::log(1 + keyframes / static_cast<double>(met_.size()));
    for (const Slot slot : met_) {
      score_[slot] += weight;
    }
  }
  [[nodiscard]] const std::vector<double>& score() const noexcept { return score_; }

 private:
  std::uint32_t voter_ = 0;
  std::vector<std::uint32_t> last_voter_;
  std::vector<Slot> met_;
  std::vector<double> score_;
};

PlaceIndex::PlaceIndex() : buckets_(kTables * kBuckets) {}

PlaceIndex::Hash PlaceIndex::hash(const Descriptor& descriptor, std::size_t table) noexcept {
  // The tables take turns, so that none gets all the best bits.
  Hash hash{.key = 0, .signature = 0};
  std::size_t index = table;
  for (std::size_t i = 0; i < kKeyBits; ++i, index += kTables) {
    hash.key |= bit(descriptor, index) << i;
  }
  for (std::size_t i = 0; i < kSignatureBits; ++i, index += kTables) {
    hash.signature |= bit(descriptor, index) << i;
  }
  return hash;
}

bool PlaceIndex::add(KeyframeId keyframe, const PlaceView& view) {
  if (slots_.size() == kMostKeyframes) {
    return false;
  }
  if (free_slots_.empty()) {
    free_slots_.push_back(slots_made_++);
  }
  const Slot slot = free_slots_.back();
  free_slots_.pop_back();
  slots_.emplace(keyframe, slot);
  for (const OrbFeature& feature : view.features) {
    for (std::size_t table = 0; table < kTables; ++table) {
      const Hash h = hash(feature.descriptor, table);
      push_tightly(bucket(table, h.key), slot << kSlotShift | h.signature);
    }
  }
  return true;
}

void PlaceIndex::remove(KeyframeId keyframe, const PlaceView& view) {
  const auto found = slots_.find(keyframe);
  if (found == slots_.end()) {
    return;
  }
  for (const OrbFeature& feature : view.features) {
    for (std::size_t table = 0; table < kTables; ++table) {
      std::erase_if(bucket(table, hash(feature.descriptor, table).key),
                    [&](Posting posting) { return posting >> kSlotShift == found->second; });
    }
  }
  free_slots_.push_back(found->second);
  slots_.erase(found);
}

void PlaceIndex::collect(std::span<const Posting> bucket, std::uint32_t signature, Votes& votes) {
  std::array<std::uint32_t, kAtOnce> distances{};
  for (std::size_t i = 0; i < bucket.size(); i += kAtOnce) {
    const auto some = bucket.subspan(i, std::min(kAtOnce, bucket.size() - i));
    signature_distances(some, signature, distances);
    for (std::size_t k = 0; k < some.size(); ++k) {
      if (distances[k] <= kSignatureDistance) {
        votes.meet(some[k] >> kSlotShift);
      }
    }
  }
}

std::vector<PlaceCandidate> PlaceIndex::query(const PlaceView& view, std::size_t most) const {
  Votes votes{slots_made_};
  const auto all = static_cast<double>(slots_.size());
  for (const OrbFeature& feature : view.features) {
    votes.begin_feature();
    for (std::size_t table = 0; table < kTables; ++table) {
      const Hash h = hash(feature.descriptor, table);
      collect(buckets_[table * kBuckets + h.key], h.signature, votes);
    }
    votes.end_feature(all);
  }
  const double whole = static_cast<double>(view.features.size()) * std::log(1 + all);
  std::vector<PlaceCandidate> ranking;
  for (const auto& [keyframe, slot] : slots_) {
    if (votes.score()[slot] > 0) {
      ranking.push_back({keyframe, votes.score()[slot] / whole});
    }
  }
  std::ranges::sort(ranking, [](const auto& a, const auto& b) {
    return a.score > b.score || (a.score == b.score && a.keyframe < b.keyframe);
  });
  ranking.resize(std::min(ranking.size(), most));
  return ranking;
}

std::size_t PlaceIndex::memory_bytes() const noexcept {
  using Bucket = std::vector<Posting>;
  return std::accumulate(buckets_.begin(), buckets_.end(), buckets_.size() * sizeof(Bucket),
                         [](std::size_t sum, const Bucket& bucket) {
                           return sum + bucket.capacity() * sizeof(Posting);
                         });
}

std::vector<PlaceCandidate> peaks(const std::vector<PlaceCandidate>& ranking, std::size_t most,
                                  std::uint32_t apart) {
  std::vector<PlaceCandidate> chosen;
  for (const PlaceCandidate& candidate : ranking) {
    if (chosen.size() == most) {
      break;
    }
    if (std::ranges::none_of(chosen, [&](const PlaceCandidate& better) {
          return ids_apart(better.keyframe, candidate.keyframe) <= apart;
        })) {
      chosen.push_back(candidate);
    }
  }
  return chosen;
}

}  // namespace geoflow::slam
