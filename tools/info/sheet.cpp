#include "info/sheet.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <fmt/core.h>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/contact_sheet.hpp"

namespace geoflow::tools {
namespace {

constexpr std::size_t kPictures = 8;
constexpr std::size_t kColumns = 4;

/// Keeps some of the colour images, and the depth image that comes next after each.
class Chooser final : public CameraSink {
 public:
  Chooser(std::uint64_t count, HostTime start)
      : every_{std::max<std::uint64_t>(count / kPictures, 1)}, start_{start} {}

  void on_color(const Arrival<CameraClock, ColorFrame>& frame) override {
    if (seen_++ % every_ == every_ / 2 && colors_.size() < kPictures) {
      colors_.push_back({.image = frame.sample.image,
                         .caption = fmt::format("{:.2f} s", to_seconds(frame.t_arrival - start_))});
    }
  }
  void on_depth(const Arrival<CameraClock, DepthFrame>& frame) override {
    if (depths_.size() < colors_.size()) {
      depths_.push_back({.image = frame.sample.image, .caption = "depth"});
    }
  }

  [[nodiscard]] bool done() const noexcept {
    return colors_.size() == kPictures && depths_.size() == kPictures;
  }

  /// Rows of colour, each followed by its row of depth.
  [[nodiscard]] std::vector<SheetImage> pictures() const {
    std::vector<SheetImage> all;
    const std::size_t pairs = std::min(colors_.size(), depths_.size());
    for (std::size_t first = 0; first < pairs; first += kColumns) {
      const std::size_t last = std::min(first + kColumns, pairs);
      for (const auto* images : {&colors_, &depths_}) {
        all.insert(all.end(), images->begin() + static_cast<std::ptrdiff_t>(first),
                   images->begin() + static_cast<std::ptrdiff_t>(last));
      }
    }
    return all;
  }
  [[nodiscard]] std::size_t pairs() const noexcept {
    return std::min(colors_.size(), depths_.size());
  }

 private:
  std::uint64_t every_;
  HostTime start_;
  std::uint64_t seen_ = 0;
  std::vector<SheetImage> colors_;
  std::vector<SheetImage> depths_;
};

}  // namespace

Result<void> draw_sheet(drivers::RecordedStreams& streams, const std::filesystem::path& path) {
  std::uint64_t count = 0;
  for (const auto& stream : streams.info().streams) {
    count += stream.stream == drivers::StreamId::kColor ? stream.count : 0;
  }
  Chooser chooser{count, streams.info().start};
  if (auto started = streams.camera().start(chooser); !started) {
    return started;
  }
  Result<bool> more = true;
  while (!chooser.done() && (!more || *more)) {  // a sample that cannot be read is passed over
    more = streams.step();
  }
  streams.camera().stop();
  if (chooser.pairs() == 0) {
    return fail(ErrorCode::kNotFound, "there are no colour images with depth to draw");
  }
  const auto columns = static_cast<int>(std::min(kColumns, chooser.pairs()));
  return save_contact_sheet(
      chooser.pictures(), {.columns = columns, .depth_unit_m = streams.calibration().depth_unit_m},
      path);
}

}  // namespace geoflow::tools
