#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>

#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/reader.hpp"

/// The inertial part of a EuRoC MAV recording: csv with stamp [ns], gyroscope x y z [rad/s],
/// accelerometer x y z [m/s^2]. Source: Burri et al., "The EuRoC micro aerial vehicle datasets",
/// IJRR 2016.
namespace geoflow::drivers::euroc {

/// The csv that `path` stands for: itself if it is a .csv file whose head fits, or
/// mav0/imu0/data.csv, imu0/data.csv, imu.csv or data.csv in the directory; none otherwise.
[[nodiscard]] std::optional<std::filesystem::path> find_csv(const std::filesystem::path& path);

/// One line of the csv, at least seven fields; the error says what is wrong with it but not where
/// it stands.
[[nodiscard]] Result<Arrival<ImuClock, ImuSample>> parse_line(std::string_view line);

/// A recording of IMU samples only, streamed. A line that does not parse is one rejected sample.
[[nodiscard]] Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& path);

}  // namespace geoflow::drivers::euroc
