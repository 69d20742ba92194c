#include "replay/calibration/yaml.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <fmt/core.h>
#include <fmt/format.h>
#include <tl/expected.hpp>
#include <yaml-cpp/yaml.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/text.hpp"

namespace geoflow::drivers::yaml {
namespace {

constexpr std::size_t kLargestFile = std::size_t{1} << 20U;
constexpr double kOrthonormalTolerance = 1e-3;
constexpr Eigen::Index kTransformSide = 4;

Result<double> scalar_number(const Entry& entry, const YAML::Node& node) {
  if (!node.IsScalar()) {
    return tl::unexpected{entry.error("a number is expected")};
  }
  const auto value = drivers::text::parse_number(node.Scalar());
  if (!value) {
    return tl::unexpected{entry.error(fmt::format("'{}' is not a number", node.Scalar()))};
  }
  return *value;
}

std::string describe(const std::exception& exception, std::string_view name, int line) {
  return line > 0 ? fmt::format("{}:{}: not YAML: {}", name, line, exception.what())
                  : fmt::format("{}: not YAML: {}", name, exception.what());
}

}  // namespace

Error Entry::error(std::string_view what) const {
  const int line = node.IsDefined() ? node.Mark().line + 1 : 0;
  std::string message = line > 0 ? fmt::format("{}:{}: ", file, line) : fmt::format("{}: ", file);
  if (!key.empty()) {
    message += key + ": ";
  }
  return Error{.code = ErrorCode::kInvalidData, .message = message.append(what)};
}

Result<Entry> parse(std::string_view name, std::string content) {
  // OpenCV writes a directive that YAML does not know.
  if (content.starts_with("%YAML:1.0")) {
    content.front() = '#';
  }
  try {
    return Entry{.file = std::string{name}, .key = {}, .node = YAML::Load(content)};
  } catch (const YAML::Exception& exception) {
    return fail(ErrorCode::kInvalidData, "{}", describe(exception, name, exception.mark.line + 1));
  } catch (const std::exception& exception) {
    return fail(ErrorCode::kInvalidData, "{}", describe(exception, name, 0));
  }
}

Result<Entry> load(const std::filesystem::path& path) {
  return drivers::text::read_file(path, kLargestFile).and_then([&](std::string content) {
    return parse(path.string(), std::move(content));
  });
}

Result<void> for_each(const Entry& map,
                      const std::function<Result<void>(const Entry&, std::string_view key)>& use) {
  if (!map.node.IsMap()) {
    return tl::unexpected{map.error("keys with values are expected")};
  }
  std::set<std::string> seen;
  for (const auto& item : map.node) {
    Entry entry{.file = map.file, .key = map.key, .node = item.first};
    if (!item.first.IsScalar()) {
      return tl::unexpected{entry.error("a key that is not a word")};
    }
    const std::string name = item.first.Scalar();
    entry.key = map.key.empty() ? name : map.key + "." + name;
    if (!seen.insert(name).second) {
      return tl::unexpected{entry.error("stands twice")};
    }
    entry.node.reset(item.second);
    if (auto used = use(entry, name); !used) {
      return used;
    }
  }
  return {};
}

Result<std::string> text(const Entry& entry) {
  if (!entry.node.IsScalar()) {
    return tl::unexpected{entry.error("a word is expected")};
  }
  return entry.node.Scalar();
}

Result<double> number(const Entry& entry) {
  return scalar_number(entry, entry.node);
}

Result<double> positive(const Entry& entry) {
  auto value = number(entry);
  if (value && *value <= 0) {
    return tl::unexpected{entry.error(fmt::format("{} is not positive", *value))};
  }
  return value;
}

Result<std::vector<double>> numbers(const Entry& entry, std::span<const std::size_t> sizes) {
  if (!entry.node.IsSequence()) {
    return tl::unexpected{entry.error("a list of numbers is expected")};
  }
  if (std::ranges::find(sizes, entry.node.size()) == sizes.end()) {
    return tl::unexpected{entry.error(fmt::format("{} numbers where {} are expected",
                                                  entry.node.size(), fmt::join(sizes, " or ")))};
  }
  std::vector<double> values;
  for (const auto& node : entry.node) {
    const auto value = scalar_number(entry, node);
    if (!value) {
      return tl::unexpected{value.error()};
    }
    values.push_back(*value);
  }
  return values;
}

Result<SE3> transform(const Entry& entry) {
  constexpr std::array<std::size_t, 1> kSide = {kTransformSide};
  if (!entry.node.IsSequence() || entry.node.size() != kSide.front()) {
    return tl::unexpected{entry.error("four rows of four numbers are expected")};
  }
  std::vector<double> values;
  for (const auto& item : entry.node) {
    const YAML::Node& row = item;
    const auto parsed = numbers(Entry{.file = entry.file, .key = entry.key, .node = row}, kSide);
    if (!parsed) {
      return tl::unexpected{parsed.error()};
    }
    values.insert(values.end(), parsed->begin(), parsed->end());
  }
  return transform_of_rows(entry, values);
}

Result<SE3> transform_of_rows(const Entry& entry, std::span<const double> values) {
  using Matrix = Eigen::Matrix<double, kTransformSide, kTransformSide, Eigen::RowMajor>;
  if (values.size() != static_cast<std::size_t>(Matrix::SizeAtCompileTime)) {
    return tl::unexpected{entry.error("16 numbers are expected")};
  }
  const Matrix matrix = Eigen::Map<const Matrix>{values.data()};
  const Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const double defect =
      (rotation.transpose() * rotation - Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(defect < kOrthonormalTolerance) || rotation.determinant() < 0) {
    return tl::unexpected{entry.error(
        fmt::format("its upper left 3 x 3 is not a rotation (off by {:.3g}, determinant {:.3g})",
                    defect, rotation.determinant()))};
  }
  if (!matrix.row(3).isApprox(Eigen::RowVector4d{0, 0, 0, 1}, 0)) {
    return tl::unexpected{entry.error("its last row is not 0 0 0 1")};
  }
  return SE3{rotation, matrix.topRightCorner<3, 1>()};
}

}  // namespace geoflow::drivers::yaml
