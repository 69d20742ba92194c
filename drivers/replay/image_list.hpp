#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/reader.hpp"

/// Lists of image files with stamps, as the TUM RGB-D benchmark has them (and OpenLORIS-Scene after
/// it). Source: cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats.
namespace geoflow::drivers {

/// One image file of a recording.
struct ListedImage {
  HostTime t;  ///< stamp of the list, on the recording's time line
  ImageStream stream = ImageStream::kColor;
  std::string file;      ///< as the list has it, relative to the recording's directory
  std::string list;      ///< name of the list
  std::size_t line = 0;  ///< in the list

  /// `rgb.txt:12: rgb/0001.png`.
  [[nodiscard]] std::string origin() const;
};

/// Lines `stamp[s] file`. Pure; errors name `list` and line.
[[nodiscard]] Result<std::vector<ListedImage>> parse_image_list(std::string_view list,
                                                                std::string_view content,
                                                                ImageStream stream);

/// Lines `stamp[s] file stamp[s] file`. Colour stands first, unless the first line's names say the
/// opposite (the first file has `depth` in its path and the second has not). Further columns are
/// not read.
[[nodiscard]] Result<std::vector<ListedImage>> parse_associations(std::string_view list,
                                                                  std::string_view content);

/// A list file of `directory`, of at most 64 MiB.
[[nodiscard]] Result<std::vector<ListedImage>> load_image_list(
    const std::filesystem::path& directory, std::string_view list, ImageStream stream);
[[nodiscard]] Result<std::vector<ListedImage>> load_associations(
    const std::filesystem::path& directory, std::string_view list);

/// Checks that there are images and that every file exists under `directory` (an Error names the
/// first that does not and how many there are), and sorts them by time, colour before depth where
/// equal and the lists' order kept otherwise.
[[nodiscard]] Result<void> prepare_images(const std::filesystem::path& directory,
                                          std::vector<ListedImage>& images);

/// The event of one image file, its bytes read but not decoded.
[[nodiscard]] Result<Event> read_image(const std::filesystem::path& directory,
                                       const ListedImage& image);

}  // namespace geoflow::drivers
