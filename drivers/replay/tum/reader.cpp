#include "replay/tum/reader.hpp"

#include <algorithm>
#include <array>
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

#include "replay/image_list.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::tum {
namespace {

constexpr std::string_view kColorList = "rgb.txt";
constexpr std::string_view kDepthList = "depth.txt";
constexpr std::array<std::string_view, 4> kAssociations = {"associations.txt", "association.txt",
                                                           "associate.txt", "associated.txt"};

bool has(const std::filesystem::path& directory, std::string_view file) {
  std::error_code error;
  return std::filesystem::is_regular_file(directory / file, error);
}

std::optional<std::string_view> associations_of(const std::filesystem::path& directory) {
  const auto* const found = std::ranges::find_if(
      kAssociations, [&](std::string_view file) { return has(directory, file); });
  return found == kAssociations.end() ? std::nullopt : std::optional{*found};
}

bool has_lists(const std::filesystem::path& directory) {
  return has(directory, kColorList) && has(directory, kDepthList);
}

Result<std::vector<ListedImage>> read_lists(const std::filesystem::path& directory) {
  if (!has_lists(directory)) {
    const auto list = associations_of(directory);
    if (!list) {
      return fail(ErrorCode::kNotFound, "{}: neither {}", directory.string(), expected_files());
    }
    return load_associations(directory, *list);
  }
  auto images = load_image_list(directory, kColorList, ImageStream::kColor);
  if (!images) {
    return images;
  }
  auto depth = load_image_list(directory, kDepthList, ImageStream::kDepth);
  if (!depth) {
    return depth;
  }
  std::ranges::move(*depth, std::back_inserter(*images));
  return images;
}

class Reader final : public RecordingReader {
 public:
  Reader(std::filesystem::path directory, std::vector<ListedImage> images)
      : directory_{std::move(directory)}, images_{std::move(images)} {
    const auto count = [this](ImageStream stream) {
      return static_cast<std::uint64_t>(std::ranges::count(images_, stream, &ListedImage::stream));
    };
    info_ = RecordingInfo{.format = "tum",
                          .start = images_.front().t,
                          .end = images_.back().t,
                          .streams = {{.name = std::string{list_of(ImageStream::kColor)},
                                       .type = "color",
                                       .count = count(ImageStream::kColor),
                                       .stream = StreamId::kColor},
                                      {.name = std::string{list_of(ImageStream::kDepth)},
                                       .type = "depth",
                                       .count = count(ImageStream::kDepth),
                                       .stream = StreamId::kDepth}}};
  }

  [[nodiscard]] const RecordingInfo& info() const override { return info_; }

  [[nodiscard]] Result<std::optional<Event>> next() override {
    if (at_ == images_.size()) {
      return std::nullopt;
    }
    return read_image(directory_, images_[at_++]);
  }

 private:
  [[nodiscard]] std::string_view list_of(ImageStream stream) const {
    const auto found = std::ranges::find(images_, stream, &ListedImage::stream);
    return found == images_.end() ? std::string_view{} : found->list;
  }

  std::filesystem::path directory_;
  std::vector<ListedImage> images_;
  std::size_t at_ = 0;
  RecordingInfo info_;
};

}  // namespace

bool looks_like(const std::filesystem::path& directory) {
  return has_lists(directory) || associations_of(directory).has_value();
}

const char* expected_files() {
  return "rgb.txt and depth.txt nor associations.txt";
}

Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& directory) {
  auto images = read_lists(directory);
  if (!images) {
    return tl::unexpected{std::move(images.error())};
  }
  if (auto prepared = prepare_images(directory, *images); !prepared) {
    return tl::unexpected{std::move(prepared.error())};
  }
  return std::make_unique<Reader>(directory, *std::move(images));
}

}  // namespace geoflow::drivers::tum
