#include "replay/calibration/find.hpp"

#include <array>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/drivers/calibration_file.hpp"
#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers {
namespace {

constexpr double kTumDepthFactor = 5000;  // counts per metre
constexpr int kTumWidth = 640;
constexpr int kTumHeight = 480;

struct Published {
  std::string_view number;
  CameraIntrinsics camera;
};

// The benchmark's figures themselves.
// NOLINTBEGIN(readability-magic-numbers)
constexpr std::array<Published, 3> kPublished = {{
    {.number = "1",
     .camera = {.width = kTumWidth,
                .height = kTumHeight,
                .fx = 517.306408,
                .fy = 516.469215,
                .cx = 318.643040,
                .cy = 255.313989,
                .model = DistortionModel::kRadtan,
                .distortion = {0.262383, -0.953104, -0.005358, 0.002628, 1.163314}}},
    {.number = "2",
     .camera = {.width = kTumWidth,
                .height = kTumHeight,
                .fx = 520.908620,
                .fy = 521.007327,
                .cx = 325.141442,
                .cy = 249.701764,
                .model = DistortionModel::kRadtan,
                .distortion = {0.231222, -0.784899, -0.003257, -0.000105, 0.917205}}},
    {.number = "3",
     .camera = {.width = kTumWidth,
                .height = kTumHeight,
                .fx = 535.4,
                .fy = 539.2,
                .cx = 320.1,
                .cy = 247.6}},
}};
// NOLINTEND(readability-magic-numbers)

/// Whether `word` stands in `text` with neither a letter before nor a digit behind it.
bool has_word(std::string_view text, std::string_view word) {
  for (std::size_t at = text.find(word); at != std::string_view::npos;
       at = text.find(word, at + 1)) {
    const char before = at == 0 ? ' ' : text[at - 1];
    const std::size_t end = at + word.size();
    const char after = end == text.size() ? ' ' : text[end];
    if (std::isalpha(static_cast<unsigned char>(before)) == 0 &&
        std::isdigit(static_cast<unsigned char>(after)) == 0) {
      return true;
    }
  }
  return false;
}

Calibration from_recording(const FoundCalibration& found, const CameraIntrinsics& camera) {
  Calibration calibration;
  calibration.camera = camera;
  calibration.depth_unit_m = found.depth_unit_m.value_or(calibration.depth_unit_m);
  calibration.depth_alignment = found.depth_alignment.value_or(calibration.depth_alignment);
  calibration.imu_noise = found.imu_noise.value_or(calibration.imu_noise);
  calibration.source = found.source;
  return calibration;
}

std::filesystem::path folder_of(const std::filesystem::path& recording) {
  std::error_code error;
  const auto absolute = std::filesystem::weakly_canonical(recording, error);
  return std::filesystem::is_directory(recording, error) ? absolute : absolute.parent_path();
}

Error none_found(const RecordingOptions& options) {
  constexpr std::string_view kAdvice = R"(: no camera calibration
Looked for: camchain-imucam.yaml or camchain.yaml in the recording's folder; camera_info in a bag or
sensors.yaml of OpenLORIS-Scene; freiburg1, freiburg2 or freiburg3 in the folder's name.
Provide --calibration DIR with a camchain.yaml like this one:
cam0:
  camera_model: pinhole
  intrinsics: [525.0, 525.0, 319.5, 239.5]  # fx fy cx cy [px]
  distortion_model: radtan
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [640, 480]
depth_factor: 1000  # counts of a depth pixel per metre)";
  return Error{.code = ErrorCode::kNotFound, .message = options.path.string().append(kAdvice)};
}

}  // namespace

std::optional<Calibration> published_calibration(std::string_view directory_name) {
  for (const Published& published : kPublished) {
    for (const std::string prefix : {"freiburg", "fr"}) {
      if (!has_word(directory_name, prefix + std::string{published.number})) {
        continue;
      }
      Calibration calibration;
      calibration.camera = published.camera;
      calibration.depth_unit_m = 1 / kTumDepthFactor;
      calibration.source = "the published camera freiburg" + std::string{published.number};
      return calibration;
    }
  }
  return std::nullopt;
}

Result<Calibration> find_calibration(const RecordingOptions& options,
                                     const RecordingReader& reader) {
  const FoundCalibration found = reader.calibration();
  const auto folder = folder_of(options.path);
  Result<Calibration> calibration;
  if (options.calibration || has_calibration(folder)) {
    calibration = load_calibration(options.calibration.value_or(folder));
  } else if (found.camera) {
    calibration = from_recording(found, *found.camera);
  } else if (auto published = published_calibration(folder.filename().string())) {
    calibration = *std::move(published);
  } else if (reader.info().has(StreamId::kColor) || reader.info().has(StreamId::kDepth)) {
    calibration = tl::unexpected{none_found(options)};
  }
  if (calibration && !calibration->T_cam_imu) {
    calibration->T_cam_imu = found.T_cam_imu;
    calibration->timeshift_cam_imu =
        found.timeshift_cam_imu.value_or(calibration->timeshift_cam_imu);
  }
  if (calibration && !calibration->T_base_cam) {
    calibration->T_base_cam = found.T_base_cam;
  }
  return calibration;
}

}  // namespace geoflow::drivers
