#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/reader.hpp"

namespace geoflow::drivers {

/// The published camera of a TUM RGB-D sequence, by a directory name that contains freiburg1,
/// freiburg2, freiburg3 or fr1, fr2, fr3 as a word. Source: the benchmark's "Intrinsic camera
/// calibration" page. Its corrections of the depth scale are applied in the published images
/// already.
[[nodiscard]] std::optional<Calibration> published_calibration(std::string_view directory_name);

/// The calibration of a recording: `options.calibration`, else Kalibr files in its folder, else
/// what it says itself, else the published one of its name. What a Kalibr file leaves open of
/// T_cam_imu and T_base_cam, the recording's own word fills in. An Error says what to provide; a
/// recording without images needs none.
[[nodiscard]] Result<Calibration> find_calibration(const RecordingOptions& options,
                                                   const RecordingReader& reader);

}  // namespace geoflow::drivers
