#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include <benchmark/benchmark.h>

#include "map/ids.hpp"
#include "map/map.hpp"
#include "place/place_index.hpp"
#include "vision/orb_features.hpp"
#include "vision/place_view.hpp"

/// What it costs to look for a view among all keyframes.
namespace geoflow::slam {
namespace {

constexpr std::size_t kFeatures = 600;
/// Features of one kind of place resemble each other: each is one of so many prototypes, with a
/// quarter of its bits changed.
constexpr std::size_t kPrototypes = 2000;

class Views {
 public:
  Views() : prototypes_(kPrototypes) {
    for (Descriptor& prototype : prototypes_) {
      std::ranges::generate(prototype, std::ref(random_));
    }
  }
  PlaceView next() {
    PlaceView view;
    view.features.resize(kFeatures);
    for (OrbFeature& feature : view.features) {
      feature.descriptor = prototypes_[random_() % kPrototypes];
      for (std::uint64_t& word : feature.descriptor) {
        const std::uint64_t quarter = random_();
        word ^= quarter & random_();
      }
    }
    return view;
  }

 private:
  std::mt19937_64 random_{1};
  std::vector<Descriptor> prototypes_;
};

void place_index_query(benchmark::State& state) {
  Views views;
  PlaceIndex index;
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(state.range(0)); ++i) {
    index.add(KeyframeId{i}, views.next());
  }
  const PlaceView view = views.next();
  while (state.KeepRunning()) {
    benchmark::DoNotOptimize(index.query(view, 10));
  }
  state.counters["MB"] = static_cast<double>(index.memory_bytes()) / 1e6;
}

void place_index_add(benchmark::State& state) {
  Views views;
  const PlaceView view = views.next();
  PlaceIndex index;
  std::uint32_t id = 0;
  while (state.KeepRunning()) {
    index.add(KeyframeId{id++}, view);
    if (id % 1000 == 0) {
      state.PauseTiming();
      index = PlaceIndex{};
      state.ResumeTiming();
    }
  }
}

BENCHMARK(place_index_query)->Arg(200)->Arg(2000)->Unit(benchmark::kMicrosecond);
BENCHMARK(place_index_add)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace geoflow::slam
