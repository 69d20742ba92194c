#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

constexpr std::size_t kTumColumns = 8;
constexpr std::size_t kKittiColumns = 12;
constexpr std::size_t kEurocColumns = 8;
/// Columns that are kept of one line; the rest is only counted.
constexpr std::size_t kMaxColumns = kKittiColumns;
constexpr double kNormTolerance = 0.01;
/// How much of a wrong word an error message shows.
constexpr std::size_t kMaxShown = 40;

struct Columns {
  std::array<std::string_view, kMaxColumns> text{};
  std::size_t count = 0;
};

/// Where a value was read, for messages.
struct Place {
  std::string_view name;
  std::size_t line = 0;
};

template <typename... Args>
tl::unexpected<Error> fail_at(const Place& place, fmt::format_string<Args...> format,
                              Args&&... args) {
  return fail(ErrorCode::kInvalidData, "{}:{}: {}", place.name, place.line,
              fmt::format(format, std::forward<Args>(args)...));
}

std::string_view shown(std::string_view text) {
  return text.substr(0, kMaxShown);
}

Columns split(std::string_view line, std::string_view separators) {
  Columns columns;
  std::size_t begin = line.find_first_not_of(separators);
  while (begin != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(separators, begin), line.size());
    if (columns.count < kMaxColumns) {
      columns.text.at(columns.count) = line.substr(begin, end - begin);
    }
    ++columns.count;
    begin = line.find_first_not_of(separators, end);
  }
  return columns;
}

constexpr std::string_view kBlanks = " \t\r\v\f";
constexpr std::string_view kCommasAndBlanks = ", \t\r\v\f";

/// The columns of one line, of whichever format.
Columns split(std::string_view line, TrajectoryFormat format) {
  return split(line, format == TrajectoryFormat::kEuroc ? kCommasAndBlanks : kBlanks);
}

Result<TrajectoryFormat> detect(std::string_view line, const Place& place) {
  if (line.find(',') != std::string_view::npos) {
    return TrajectoryFormat::kEuroc;
  }
  const Columns columns = split(line, kBlanks);
  if (columns.count == kTumColumns) {
    return TrajectoryFormat::kTum;
  }
  if (columns.count == kKittiColumns) {
    return TrajectoryFormat::kKitti;
  }
  return fail_at(place,
                 "'{}' is no trajectory: expected 8 numbers (TUM: timestamp tx ty tz qx qy qz qw), "
                 "12 numbers (KITTI) or comma-separated values (EuRoC), found {} words",
                 shown(line), columns.count);
}

/// `count` finite numbers from column `first` on, written to `out`.
Result<void> parse_numbers(const Columns& columns, std::size_t first, std::size_t count,
                           const Place& place, double* out) {
  for (std::size_t i = first; i < first + count; ++i) {
    std::string_view text = columns.text.at(i);
    if (text.starts_with('+')) {
      text.remove_prefix(1);
    }
    double value = 0;
    const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (status != std::errc{} || end != text.data() + text.size()) {
      return fail_at(place, "column {}: '{}' is not a number", i + 1, shown(columns.text.at(i)));
    }
    if (!std::isfinite(value)) {
      return fail_at(place, "column {}: '{}' is not a finite number", i + 1,
                     shown(columns.text.at(i)));
    }
    *out++ = value;
  }
  return {};
}

Result<Eigen::Quaterniond> checked_rotation(const Eigen::Quaterniond& q, const Place& place) {
  const double norm = q.norm();
  if (!(std::abs(norm - 1.0) <= kNormTolerance)) {
    return fail_at(place, "the quaternion's norm is {:.6g} instead of 1", norm);
  }
  return q.normalized();
}

Result<StampedPose> parse_tum(const Columns& columns, const Place& place) {
  const auto t = parse_decimal_seconds(columns.text[0]);
  if (!t || std::chrono::abs(*t) > kMaxTrajectoryTime) {
    return fail_at(place, "column 1: '{}' is not a time in seconds", shown(columns.text[0]));
  }
  std::array<double, kTumColumns - 1> v{};  // x y z qx qy qz qw
  if (auto done = parse_numbers(columns, 1, v.size(), place, v.data()); !done) {
    return tl::unexpected{std::move(done).error()};
  }
  return checked_rotation(Eigen::Quaterniond{&v[3]}, place).map([&](const Eigen::Quaterniond& q) {
    return StampedPose{.t = HostTime{*t}, .pose = SE3{q, Vector3d{v[0], v[1], v[2]}}};
  });
}

Result<StampedPose> parse_euroc(const Columns& columns, const Place& place) {
  const std::string_view text = columns.text[0];
  std::int64_t ns = 0;
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), ns);
  if (status != std::errc{} || end != text.data() + text.size() ||
      ns > kMaxTrajectoryTime.count() || ns < -kMaxTrajectoryTime.count()) {
    return fail_at(place, "column 1: '{}' is not a time in integer nanoseconds", shown(text));
  }
  std::array<double, kEurocColumns - 1> v{};  // x y z qw qx qy qz
  if (auto done = parse_numbers(columns, 1, v.size(), place, v.data()); !done) {
    return tl::unexpected{std::move(done).error()};
  }
  Eigen::Quaterniond rotation;
  rotation.w() = v[3];
  rotation.vec() = Eigen::Map<const Vector3d>{&v[4]};
  return checked_rotation(rotation, place).map([&](const Eigen::Quaterniond& q) {
    return StampedPose{.t = HostTime{Duration{ns}}, .pose = SE3{q, Vector3d{v[0], v[1], v[2]}}};
  });
}

Result<StampedPose> parse_kitti(const Columns& columns, const Place& place, TrajectoryFile& file) {
  using Matrix34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;
  Matrix34 T_ref_body;
  if (auto done = parse_numbers(columns, 0, kKittiColumns, place, T_ref_body.data()); !done) {
    return tl::unexpected{std::move(done).error()};
  }
  const Matrix3d M = T_ref_body.leftCols<3>();
  const double deviation = (M.transpose() * M - Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(deviation <= 2.0 * kNormTolerance) || !(M.determinant() > 0)) {
    return fail_at(place,
                   "the left 3 x 3 part is no rotation (R^T R differs from the identity by "
                   "{:.3g}, its determinant is {:.3g})",
                   deviation, M.determinant());
  }
  file.matrices.push_back(M);
  const Duration t = std::chrono::seconds{static_cast<std::int64_t>(file.poses.size())};
  return StampedPose{.t = HostTime{t}, .pose = SE3{M, Vector3d{T_ref_body.col(3)}}};
}

Result<StampedPose> parse_line(std::string_view line, TrajectoryFormat format, const Place& place,
                               TrajectoryFile& file) {
  const Columns columns = split(line, format);
  switch (format) {
    case TrajectoryFormat::kTum:
      if (columns.count != kTumColumns) {
        return fail_at(place, "expected 8 numbers (timestamp tx ty tz qx qy qz qw), found {}",
                       columns.count);
      }
      return parse_tum(columns, place);
    case TrajectoryFormat::kKitti:
      if (columns.count != kKittiColumns) {
        return fail_at(place, "expected the 12 numbers of a 3 x 4 matrix, found {}", columns.count);
      }
      return parse_kitti(columns, place, file);
    case TrajectoryFormat::kEuroc:
      if (columns.count < kEurocColumns) {
        return fail_at(place,
                       "expected at least 8 values (timestamp, px, py, pz, qw, qx, qy, qz), "
                       "found {}",
                       columns.count);
      }
      return parse_euroc(columns, place);
  }
  return fail_at(place, "unknown trajectory format");
}

/// Sorts by time and keeps the first of equal times; says what it did.
void put_in_order(TrajectoryFile& file, std::string_view name) {
  const auto time = [](const StampedPose& stamped) { return stamped.t; };
  if (!std::ranges::is_sorted(file.poses, {}, time)) {
    std::vector<std::pair<HostTime, std::size_t>> order;
    for (const StampedPose& stamped : file.poses) {
      order.emplace_back(stamped.t, order.size());
    }
    std::ranges::sort(order);
    Trajectory sorted;
    for (const auto& [t, index] : order) {
      sorted.push_back(file.poses[index]);
    }
    file.poses = std::move(sorted);
    file.warnings.push_back(
        fmt::format("{}: the poses are not in order of time; they were sorted", name));
  }
  const auto repetitions = std::ranges::unique(file.poses, {}, time);
  const std::size_t repeated = repetitions.size();
  if (repeated > 0) {
    file.poses.erase(repetitions.begin(), repetitions.end());
    file.warnings.push_back(fmt::format(
        "{}: {} poses repeat the time of another one; the first of each counts", name, repeated));
  }
}

}  // namespace

Result<TrajectoryFile> parse_trajectory(std::string_view text, std::string_view name,
                                        std::optional<TrajectoryFormat> format) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) {
    text.remove_prefix(kByteOrderMark.size());
  }
  TrajectoryFile file;
  Place place{.name = name};
  while (!text.empty()) {
    const std::size_t length = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, length);
    text.remove_prefix(std::min(length + 1, text.size()));
    ++place.line;
    const std::size_t first = line.find_first_not_of(kBlanks);
    if (first == std::string_view::npos || line[first] == '#') {
      continue;
    }
    if (!format) {
      auto detected = detect(line, place);
      if (!detected) {
        return tl::unexpected{std::move(detected).error()};
      }
      format = *detected;
    }
    auto pose = parse_line(line, *format, place, file);
    if (!pose) {
      return tl::unexpected{std::move(pose).error()};
    }
    file.poses.push_back(*pose);
  }
  if (file.poses.empty()) {
    return fail(ErrorCode::kInvalidData, "{}: holds no pose", name);
  }
  file.format = format.value_or(TrajectoryFormat::kTum);
  put_in_order(file, name);
  return file;
}

}  // namespace geoflow::tools
