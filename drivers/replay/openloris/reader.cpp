#include "replay/openloris/reader.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/image_list.hpp"
#include "replay/line_file.hpp"
#include "replay/openloris/calibration.hpp"
#include "replay/openloris/imu_merge.hpp"
#include "replay/reader.hpp"
#include "replay/text.hpp"

namespace geoflow::drivers::openloris {
namespace {

constexpr std::size_t kLargestYaml = std::size_t{1} << 20U;
constexpr std::string_view kColorList = "color.txt";
constexpr std::string_view kDepthList = "aligned_depth.txt";
constexpr std::string_view kAccelerometer = "d400_accelerometer.txt";
constexpr std::string_view kGyroscope = "d400_gyroscope.txt";
constexpr std::string_view kSensors = "sensors.yaml";
constexpr std::string_view kTransforms = "trans_matrix.yaml";

bool has(const std::filesystem::path& directory, std::string_view file) {
  std::error_code error;
  return std::filesystem::is_regular_file(directory / file, error);
}

Result<std::vector<ListedImage>> read_images(const std::filesystem::path& directory) {
  std::vector<ListedImage> images;
  for (const auto& [list, stream] :
       {std::pair{kColorList, ImageStream::kColor}, std::pair{kDepthList, ImageStream::kDepth}}) {
    auto read = load_image_list(directory, list, stream);
    if (!read) {
      return read;
    }
    std::ranges::move(*read, std::back_inserter(images));
  }
  return images;
}

Result<FoundCalibration> read_calibration(const std::filesystem::path& directory) {
  if (!has(directory, kSensors)) {
    return FoundCalibration{};
  }
  const std::string sensors = (directory / kSensors).string();
  auto found = text::read_file(sensors, kLargestYaml).and_then([&](std::string content) {
    return parse_sensors(sensors, std::move(content));
  });
  if (!found || !has(directory, kTransforms)) {
    return found;
  }
  const std::string transforms = (directory / kTransforms).string();
  auto filled = text::read_file(transforms, kLargestYaml).and_then([&](std::string content) {
    return parse_transforms(transforms, std::move(content), *found);
  });
  return filled ? found : tl::unexpected{std::move(filled.error())};
}

/// How many lines a list of vectors has, and the stamps of its first and last.
struct Survey {
  std::uint64_t count = 0;
  HostTime first = HostTime::max();
  HostTime last = HostTime::min();
};

Result<Survey> survey(const std::filesystem::path& path) {
  auto file = text::LineFile::open(path);
  if (!file) {
    return tl::unexpected{std::move(file.error())};
  }
  Survey survey;
  for (auto line = file->next(); !line || line->has_value(); line = file->next()) {
    const auto found = line.value_or(std::nullopt);
    if (!found) {
      continue;
    }
    if (const auto parsed = parse_vector(found->text)) {
      ++survey.count;
      survey.first = std::min(survey.first, parsed->t);
      survey.last = std::max(survey.last, parsed->t);
    }
  }
  return survey;
}

class Reader final : public RecordingReader {
 public:
  Reader(std::filesystem::path directory, std::vector<ListedImage> images,
         FoundCalibration calibration)
      : directory_{std::move(directory)},
        images_{std::move(images)},
        calibration_{std::move(calibration)},
        info_{.format = "openloris",
              .start = images_.front().t,
              .end = images_.back().t,
              .streams = {}} {
    add_images(kColorList, ImageStream::kColor, StreamId::kColor);
    add_images(kDepthList, ImageStream::kDepth, StreamId::kDepth);
  }

  [[nodiscard]] Result<void> add_imu() {
    auto surveyed = survey(directory_ / kGyroscope);
    auto accelerometer = text::LineFile::open(directory_ / kAccelerometer);
    auto gyroscope = text::LineFile::open(directory_ / kGyroscope);
    if (!surveyed || !accelerometer || !gyroscope) {
      return fail(ErrorCode::kSystem, "{}: {} or {} cannot be read", directory_.string(),
                  kAccelerometer, kGyroscope);
    }
    info_.start = std::min(info_.start, surveyed->first);
    info_.end = std::max(info_.end, surveyed->last);
    info_.streams.push_back({.name = std::string{kGyroscope},
                             .type = "imu",
                             .count = surveyed->count,
                             .stream = StreamId::kImu});
    imu_.emplace(*std::move(accelerometer), *std::move(gyroscope));
    return {};
  }

  [[nodiscard]] const RecordingInfo& info() const override { return info_; }
  [[nodiscard]] FoundCalibration calibration() const override { return calibration_; }

  [[nodiscard]] Result<std::optional<Event>> next() override {
    if (imu_ && !sample_) {
      auto sample = imu_->next();
      if (!sample) {
        return tl::unexpected{std::move(sample.error())};
      }
      sample_ = *std::move(sample);
      if (!sample_) {
        imu_.reset();
      }
    }
    const bool images_left = at_ < images_.size();
    if (sample_ && (!images_left || sample_->t_arrival <= images_[at_].t)) {
      Event event{*sample_};
      sample_.reset();
      return event;
    }
    if (!images_left) {
      return std::nullopt;
    }
    return read_image(directory_, images_[at_++]);
  }

 private:
  void add_images(std::string_view list, ImageStream stream, StreamId id) {
    const auto count = std::ranges::count(images_, stream, &ListedImage::stream);
    info_.streams.push_back({.name = std::string{list},
                             .type = std::string{name(id)},
                             .count = static_cast<std::uint64_t>(count),
                             .stream = id});
  }

  std::filesystem::path directory_;
  std::vector<ListedImage> images_;
  FoundCalibration calibration_;
  RecordingInfo info_;
  std::size_t at_ = 0;
  std::optional<ImuMerge> imu_;
  std::optional<Arrival<ImuClock, ImuSample>> sample_;  // read, but later than the next image
};

}  // namespace

bool looks_like(const std::filesystem::path& directory) {
  return has(directory, kColorList) && has(directory, kDepthList);
}

Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& directory) {
  auto images = read_images(directory);
  if (!images) {
    return tl::unexpected{std::move(images.error())};
  }
  if (auto checked = prepare_images(directory, *images); !checked) {
    return tl::unexpected{std::move(checked.error())};
  }
  auto calibration = read_calibration(directory);
  if (!calibration) {
    return tl::unexpected{std::move(calibration.error())};
  }
  auto reader = std::make_unique<Reader>(directory, *std::move(images), *std::move(calibration));
  if (has(directory, kAccelerometer) && has(directory, kGyroscope)) {
    if (auto added = reader->add_imu(); !added) {
      return tl::unexpected{std::move(added.error())};
    }
  }
  return reader;
}

}  // namespace geoflow::drivers::openloris
