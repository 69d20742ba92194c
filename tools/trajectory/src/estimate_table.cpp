#include "geoflow/tools/estimate_table.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tools {
namespace {

constexpr std::string_view kHeader =
    "#t[ns],px[m],py,pz,qw,qx,qy,qz,status,source,quality,reset_counter,map_id,"
    "rx_rx[rad^2],rx_ry,rx_rz,rx_x[rad m],rx_y,rx_z,ry_ry,ry_rz,ry_x,ry_y,ry_z,rz_rz,rz_x,rz_y,"
    "rz_z,x_x[m^2],x_y,x_z,y_y,y_z,z_z\n";
constexpr std::size_t kPoseColumn = 1;
constexpr std::size_t kStatusColumn = 8;
constexpr std::size_t kSourceColumn = 9;
constexpr std::size_t kQualityColumn = 10;
constexpr std::size_t kResetColumn = 11;
constexpr std::size_t kMapColumn = 12;
constexpr std::size_t kCovarianceColumn = 13;
constexpr std::size_t kCovarianceValues = 21;
constexpr std::size_t kColumns = kCovarianceColumn + kCovarianceValues;
constexpr double kNormTolerance = 1e-6;

std::string line_of(const PoseEstimate& estimate) {
  const Vector3d& p = estimate.T_odom_base.translation();
  const Eigen::Quaterniond& q = estimate.T_odom_base.rotation();
  std::string line =
      fmt::format("{},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{},{},{},{},{}",
                  estimate.t.time_since_epoch().count(), p.x(), p.y(), p.z(), q.w(), q.x(), q.y(),
                  q.z(), to_string(estimate.status), to_string(estimate.source), estimate.quality,
                  estimate.reset_counter, estimate.map_id);
  for (Eigen::Index row = 0; row < estimate.covariance.rows(); ++row) {
    for (Eigen::Index column = row; column < estimate.covariance.cols(); ++column) {
      line += fmt::format(",{:.6e}", estimate.covariance(row, column));
    }
  }
  line += '\n';
  return line;
}

using Columns = std::array<std::string_view, kColumns>;

/// None where their number is another.
std::optional<Columns> split(std::string_view line) {
  Columns columns;
  for (std::size_t i = 0; i < kColumns; ++i) {
    const std::size_t comma = line.find(',');
    if ((comma == std::string_view::npos) != (i + 1 == kColumns)) {
      return std::nullopt;
    }
    columns.at(i) = line.substr(0, comma);
    line.remove_prefix(std::min(line.size(), columns.at(i).size() + 1));
  }
  return columns;
}

template <typename Number>
std::optional<Number> number(std::string_view text) {
  Number value{};
  const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (status != std::errc{} || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return value;
}

/// The finite numbers from column `first` on; the message where one is none.
Result<void> take_numbers(const Columns& columns, std::size_t first, std::size_t count,
                          double* out) {
  for (std::size_t i = first; i < first + count; ++i) {
    const auto value = number<double>(columns.at(i));
    if (!value || !std::isfinite(*value)) {
      return fail(ErrorCode::kInvalidData, "column {}: '{}' is not a finite number", i + 1,
                  columns.at(i));
    }
    *out++ = *value;
  }
  return {};
}

/// The value of an enumeration, from 0 to `last`, that has this name.
template <typename Enum>
std::optional<Enum> named(std::string_view text, Enum last) {
  for (std::uint8_t i = 0; i <= static_cast<std::uint8_t>(last); ++i) {
    if (text == to_string(static_cast<Enum>(i))) {
      return static_cast<Enum>(i);
    }
  }
  return std::nullopt;
}

/// Puts what a column was read as in its place; the message, with what was `expected`, where it is
/// none.
template <typename Value>
Result<void> take(const Columns& columns, std::size_t column, const std::optional<Value>& value,
                  std::string_view expected, Value& out) {
  if (!value) {
    return fail(ErrorCode::kInvalidData, "column {}: '{}' is no {}", column + 1, columns.at(column),
                expected);
  }
  out = *value;
  return {};
}

template <typename Number>
Result<void> take_number(const Columns& columns, std::size_t column, std::string_view expected,
                         Number& out) {
  return take(columns, column, number<Number>(columns.at(column)), expected, out);
}

/// The columns between pose and covariance.
Result<void> take_account(const Columns& columns, PoseEstimate& out) {
  const auto status = named(columns.at(kStatusColumn), TrackingStatus::kLost);
  const auto source = named(columns.at(kSourceColumn), PoseSource::kConstantVelocity);
  return take(columns, kStatusColumn, status, "status", out.status)
      .and_then([&] { return take(columns, kSourceColumn, source, "source", out.source); })
      .and_then([&] { return take_number(columns, kQualityColumn, "quality", out.quality); })
      .and_then([&] { return take_number(columns, kResetColumn, "count", out.reset_counter); })
      .and_then([&] { return take_number(columns, kMapColumn, "part of a map", out.map_id); });
}

Result<PoseEstimate> parse_line(std::string_view line) {
  const std::optional<Columns> columns = split(line);
  if (!columns) {
    return fail(ErrorCode::kInvalidData, "expected the {} columns of estimates.csv", kColumns);
  }
  const auto t = number<std::int64_t>(columns->front());
  if (!t) {
    return fail(ErrorCode::kInvalidData, "column 1: '{}' is not a time in integer nanoseconds",
                columns->front());
  }
  PoseEstimate estimate;
  estimate.t = HostTime{Duration{*t}};
  std::array<double, kStatusColumn - kPoseColumn> pose{};  // x y z qw qx qy qz
  std::array<double, kCovarianceValues> upper{};
  auto read =
      take_account(*columns, estimate)
          .and_then([&] { return take_numbers(*columns, kPoseColumn, pose.size(), pose.data()); })
          .and_then([&] {
            return take_numbers(*columns, kCovarianceColumn, upper.size(), upper.data());
          });
  if (!read) {
    return tl::unexpected{std::move(read).error()};
  }
  const Eigen::Quaterniond q{pose[3], pose[4], pose[5], pose[6]};
  if (!(std::abs(q.norm() - 1) <= kNormTolerance)) {
    return fail(ErrorCode::kInvalidData, "the quaternion's norm is {:.9g} instead of 1", q.norm());
  }
  estimate.T_odom_base = SE3{q, Vector3d{pose[0], pose[1], pose[2]}};
  std::size_t next = 0;
  for (Eigen::Index row = 0; row < estimate.covariance.rows(); ++row) {
    for (Eigen::Index column = row; column < estimate.covariance.cols(); ++column) {
      estimate.covariance(row, column) = estimate.covariance(column, row) = upper.at(next++);
    }
  }
  return estimate;
}

}  // namespace

Result<void> write_estimates(const std::filesystem::path& path,
                             const std::vector<PoseEstimate>& estimates) {
  std::string text{kHeader};
  for (const PoseEstimate& estimate : estimates) {
    text += line_of(estimate);
  }
  std::ofstream stream{path, std::ios::binary | std::ios::trunc};
  stream.write(text.data(), static_cast<std::streamsize>(text.size()));
  stream.close();  // a full disk shows at the latest here
  return stream ? Result<void>{} : fail_errno(path.string());
}

Result<std::vector<PoseEstimate>> read_estimates(const std::filesystem::path& path) {
  std::ifstream stream{path, std::ios::binary};
  if (!stream) {
    return fail_errno(path.string());
  }
  std::vector<PoseEstimate> estimates;
  std::string line;
  for (std::size_t number = 1; std::getline(stream, line); ++number) {
    if (line.empty() || line.front() == '#') {
      continue;
    }
    auto estimate = parse_line(line);
    if (!estimate) {
      return fail(ErrorCode::kInvalidData, "{}:{}: {}", path.string(), number,
                  estimate.error().message);
    }
    if (!estimates.empty() && estimate->t <= estimates.back().t) {
      return fail(ErrorCode::kInvalidData, "{}:{}: the time does not come after the line before's",
                  path.string(), number);
    }
    estimates.push_back(*std::move(estimate));
  }
  if (stream.bad()) {
    return fail_errno(path.string());
  }
  if (estimates.empty()) {
    return fail(ErrorCode::kInvalidData, "{}: no estimate in it", path.string());
  }
  return estimates;
}

}  // namespace geoflow::tools
