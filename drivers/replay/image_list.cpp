#include "replay/image_list.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/reader.hpp"
#include "replay/text.hpp"

namespace geoflow::drivers {
namespace {

constexpr std::size_t kLargestList = std::size_t{64} << 20U;
constexpr std::size_t kLargestImageFile = std::size_t{64} << 20U;

Result<ListedImage> parse_entry(std::string_view list, std::size_t line, std::string_view stamp,
                                std::string_view file) {
  const auto t = text::parse_seconds(stamp);
  if (!t) {
    return fail(ErrorCode::kInvalidData, "{}:{}: '{}' is not a time in seconds", list, line, stamp);
  }
  return ListedImage{
      .t = HostTime{*t}, .file = std::string{file}, .list = std::string{list}, .line = line};
}

bool names_depth(std::string_view file) {
  return file.find("depth") != std::string_view::npos;
}

Result<void> check_files(const std::filesystem::path& directory,
                         const std::vector<ListedImage>& images) {
  const ListedImage* first = nullptr;
  std::size_t missing = 0;
  for (const ListedImage& image : images) {
    std::error_code error;
    if (std::filesystem::is_regular_file(directory / image.file, error)) {
      continue;
    }
    ++missing;
    if (first == nullptr || std::tie(image.list, image.line) < std::tie(first->list, first->line)) {
      first = &image;
    }
  }
  if (first != nullptr) {
    return fail(
        ErrorCode::kNotFound, "{}: no such file ({} of the {} listed files missing)",
        (directory / first->list).string() + fmt::format(":{}: {}", first->line, first->file),
        missing, images.size());
  }
  return {};
}

}  // namespace

std::string ListedImage::origin() const {
  return fmt::format("{}:{}: {}", list, line, file);
}

Result<std::vector<ListedImage>> parse_image_list(std::string_view list, std::string_view content,
                                                  ImageStream stream) {
  std::vector<ListedImage> images;
  auto parsed = text::for_each_line(list, content, [&](const text::Line& line) -> Result<void> {
    const auto fields = text::split_blanks(line.text);
    if (fields.size() != 2) {
      return fail(ErrorCode::kInvalidData, "{}:{}: {} fields where 'seconds file' is expected",
                  list, line.number, fields.size());
    }
    auto image = parse_entry(list, line.number, fields[0], fields[1]);
    if (!image) {
      return tl::unexpected{std::move(image.error())};
    }
    image->stream = stream;
    images.push_back(*std::move(image));
    return {};
  });
  if (!parsed) {
    return tl::unexpected{std::move(parsed.error())};
  }
  return images;
}

Result<std::vector<ListedImage>> parse_associations(std::string_view list,
                                                    std::string_view content) {
  std::vector<ListedImage> images;
  std::optional<bool> depth_first;
  auto parsed = text::for_each_line(list, content, [&](const text::Line& line) -> Result<void> {
    const auto fields = text::split_blanks(line.text);
    if (fields.size() < 4) {
      return fail(ErrorCode::kInvalidData,
                  "{}:{}: {} fields where 'seconds file seconds file' is expected", list,
                  line.number, fields.size());
    }
    if (!depth_first) {
      depth_first = names_depth(fields[1]) && !names_depth(fields[3]);
    }
    for (const std::size_t at : {std::size_t{0}, std::size_t{2}}) {
      auto image = parse_entry(list, line.number, fields[at], fields[at + 1]);
      if (!image) {
        return tl::unexpected{std::move(image.error())};
      }
      image->stream = (at == 0) == *depth_first ? ImageStream::kDepth : ImageStream::kColor;
      images.push_back(*std::move(image));
    }
    return {};
  });
  if (!parsed) {
    return tl::unexpected{std::move(parsed.error())};
  }
  return images;
}

Result<std::vector<ListedImage>> load_image_list(const std::filesystem::path& directory,
                                                 std::string_view list, ImageStream stream) {
  const std::string path = (directory / list).string();
  return text::read_file(path, kLargestList).and_then([&](const std::string& content) {
    return parse_image_list(list, content, stream).map_error([&](Error error) {
      return std::move(error).in(directory.string());
    });
  });
}

Result<std::vector<ListedImage>> load_associations(const std::filesystem::path& directory,
                                                   std::string_view list) {
  return text::read_file(directory / list, kLargestList).and_then([&](const std::string& content) {
    return parse_associations(list, content).map_error([&](Error error) {
      return std::move(error).in(directory.string());
    });
  });
}

Result<void> prepare_images(const std::filesystem::path& directory,
                            std::vector<ListedImage>& images) {
  if (images.empty()) {
    return fail(ErrorCode::kInvalidData, "{}: its lists name no image", directory.string());
  }
  auto checked = check_files(directory, images);
  std::ranges::sort(images, [](const ListedImage& a, const ListedImage& b) {
    return std::tie(a.t, a.stream, a.list, a.line) < std::tie(b.t, b.stream, b.list, b.line);
  });
  return checked;
}

Result<Event> read_image(const std::filesystem::path& directory, const ListedImage& image) {
  auto content = text::read_file(directory / image.file, kLargestImageFile);
  if (!content) {
    return tl::unexpected{
        std::move(content.error()).in(fmt::format("{}:{}", image.list, image.line))};
  }
  EncodedImage encoded{.stream = image.stream, .origin = image.origin()};
  encoded.bytes.resize(content->size());
  std::memcpy(encoded.bytes.data(), content->data(), content->size());
  return Arrival<CameraClock, EncodedImage>{
      .t_device = DeviceTime<CameraClock>{image.t.time_since_epoch()},
      .t_arrival = image.t,
      .sample = std::move(encoded)};
}

}  // namespace geoflow::drivers
