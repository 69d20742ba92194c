#include "replay/euroc/reader.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/line_file.hpp"
#include "replay/reader.hpp"
#include "replay/text.hpp"

namespace geoflow::drivers::euroc {
namespace {

constexpr std::array<std::string_view, 4> kPlaces = {"mav0/imu0/data.csv", "imu0/data.csv",
                                                     "imu.csv", "data.csv"};
constexpr std::size_t kFields = 7;
constexpr std::size_t kGyroAt = 1;
constexpr std::size_t kAccelAt = 4;

/// The first data line, if the file's head has one that parses (a head line without '#' may stand
/// before it).
bool head_fits(const std::filesystem::path& path) {
  auto file = text::LineFile::open(path);
  for (int attempt = 0; file && attempt < 2; ++attempt) {
    const auto line = file->next().value_or(std::nullopt);
    if (!line) {
      return false;
    }
    if (parse_line(line->text)) {
      return true;
    }
  }
  return false;
}

/// Whether a first line names columns.
bool is_head(const Result<std::optional<text::Line>>& first) {
  const auto line = first.value_or(std::nullopt);
  return line && !parse_line(line->text);
}

class Reader final : public RecordingReader {
 public:
  Reader(text::LineFile file, RecordingInfo info)
      : file_{std::move(file)}, info_{std::move(info)} {}

  [[nodiscard]] const RecordingInfo& info() const override { return info_; }

  [[nodiscard]] Result<std::optional<Event>> next() override {
    auto line = file_.next();
    if (!std::exchange(begun_, true) && is_head(line)) {
      line = file_.next();
    }
    if (!line) {
      return tl::unexpected{std::move(line.error())};
    }
    const std::optional<text::Line>& found = *line;
    if (!found) {
      return std::nullopt;
    }
    auto sample = parse_line(found->text);
    if (!sample) {
      return tl::unexpected{std::move(sample.error()).in(file_.where())};
    }
    return Event{*sample};
  }

 private:
  text::LineFile file_;
  RecordingInfo info_;
  bool begun_ = false;
};

/// Reads the file once for what info() says.
Result<RecordingInfo> survey(const std::filesystem::path& path) {
  auto file = text::LineFile::open(path);
  if (!file) {
    return tl::unexpected{std::move(file.error())};
  }
  std::uint64_t count = 0;
  std::optional<HostTime> start;
  HostTime end;
  for (auto line = file->next(); !line || line->has_value(); line = file->next()) {
    const auto found = line.value_or(std::nullopt);
    if (!found) {
      continue;
    }
    if (const auto sample = parse_line(found->text)) {
      start = start.value_or(sample->t_arrival);
      end = sample->t_arrival;
      ++count;
    }
  }
  if (!start) {
    return fail(ErrorCode::kInvalidData, "{}: no line with stamp, gyroscope and accelerometer",
                path.string());
  }
  return RecordingInfo{.format = "euroc",
                       .start = *start,
                       .end = end,
                       .streams = {{.name = path.filename().string(),
                                    .type = "imu",
                                    .count = count,
                                    .stream = StreamId::kImu}}};
}

}  // namespace

std::optional<std::filesystem::path> find_csv(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) {
    return path.extension() == ".csv" && head_fits(path) ? std::optional{path} : std::nullopt;
  }
  for (const std::string_view place : kPlaces) {
    if (head_fits(path / place)) {
      return path / place;
    }
  }
  return std::nullopt;
}

Result<Arrival<ImuClock, ImuSample>> parse_line(std::string_view line) {
  const auto fields = text::split(line, ',');
  if (fields.size() < kFields) {
    return fail(ErrorCode::kInvalidData,
                "{} fields where 7 are expected: stamp [ns], gyroscope x y z, accelerometer x y z",
                fields.size());
  }
  const auto stamp = text::parse_nanoseconds(fields.front());
  if (!stamp) {
    return fail(ErrorCode::kInvalidData, "'{}' is not a time in nanoseconds", fields.front());
  }
  std::array<double, kFields> values{};
  for (std::size_t i = kGyroAt; i < kFields; ++i) {
    const auto value = text::parse_number(fields[i]);
    if (!value) {
      return fail(ErrorCode::kInvalidData, "'{}' is not a number", fields[i]);
    }
    values[i] = *value;
  }
  return Arrival<ImuClock, ImuSample>{.t_device = DeviceTime<ImuClock>{*stamp},
                                      .t_arrival = HostTime{*stamp},
                                      .sample = {.accel_mps2 = Vector3d{&values[kAccelAt]},
                                                 .gyro_radps = Vector3d{&values[kGyroAt]}}};
}

Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& path) {
  const auto csv = find_csv(path);
  if (!csv) {
    return fail(ErrorCode::kNotFound, "{}: no csv of EuRoC's inertial form", path.string());
  }
  auto info = survey(*csv);
  auto file = text::LineFile::open(*csv);
  if (!info || !file) {
    return tl::unexpected{info ? std::move(file.error()) : std::move(info.error())};
  }
  return std::make_unique<Reader>(*std::move(file), *std::move(info));
}

}  // namespace geoflow::drivers::euroc
