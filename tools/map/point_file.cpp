#include "map/point_file.hpp"

#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/core.h>
#include <tl/expected.hpp>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/slam/saved_map.hpp"

namespace geoflow::tools {
namespace {

/// A property's name in PLY and its field's in PCD.
struct Property {
  std::string_view ply;
  std::string_view pcd;
};

constexpr Property kX{.ply = "x", .pcd = "x"};
constexpr Property kY{.ply = "y", .pcd = "y"};
constexpr Property kZ{.ply = "z", .pcd = "z"};
constexpr std::array kPosition{kX, kY, kZ};
constexpr std::array kSurfel{kX,
                             kY,
                             kZ,
                             Property{.ply = "nx", .pcd = "normal_x"},
                             Property{.ply = "ny", .pcd = "normal_y"},
                             Property{.ply = "nz", .pcd = "normal_z"},
                             Property{.ply = "sigma", .pcd = "sigma"}};

std::string ply_header(std::size_t points, std::span<const Property> properties) {
  std::string text =
      fmt::format("ply\nformat ascii 1.0\ncomment metres\nelement vertex {}\n", points);
  for (const Property& property : properties) {
    text += fmt::format("property float {}\n", property.ply);
  }
  return text + "end_header\n";
}

std::string pcd_header(std::size_t points, std::span<const Property> properties) {
  std::string fields;
  std::string sizes;
  std::string types;
  std::string counts;
  for (const Property& property : properties) {
    fields += fmt::format(" {}", property.pcd);
    sizes += " 4";
    types += " F";
    counts += " 1";
  }
  return fmt::format(
      "# metres\nVERSION .7\nFIELDS{}\nSIZE{}\nTYPE{}\nCOUNT{}\nWIDTH {}\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA ascii\n",
      fields, sizes, types, counts, points, points);
}

/// The header that the file's name asks for.
Result<std::string> header(const std::filesystem::path& path, std::size_t points,
                           std::span<const Property> properties) {
  if (path.extension() == ".ply") {
    return ply_header(points, properties);
  }
  if (path.extension() == ".pcd") {
    return pcd_header(points, properties);
  }
  return fail(ErrorCode::kInvalidArgument, "{}: points are written as .ply or .pcd", path.string());
}

Result<void> write(const std::filesystem::path& path, std::string_view text) {
  std::ofstream out{path, std::ios::binary | std::ios::trunc};
  out.write(text.data(), static_cast<std::streamsize>(text.size()));
  out.close();
  return out ? Result<void>{} : fail(ErrorCode::kSystem, "{}: cannot be written", path.string());
}

}  // namespace

Result<void> write_points(const std::filesystem::path& path, std::span<const Vector3d> points) {
  auto text = header(path, points.size(), kPosition);
  if (!text) {
    return tl::unexpected{std::move(text.error())};
  }
  for (const Vector3d& p : points) {
    fmt::format_to(std::back_inserter(*text), "{:.4f} {:.4f} {:.4f}\n", p.x(), p.y(), p.z());
  }
  return write(path, *text);
}

Result<void> write_points(const std::filesystem::path& path,
                          std::span<const slam::MapSurfel> surfels) {
  auto text = header(path, surfels.size(), kSurfel);
  if (!text) {
    return tl::unexpected{std::move(text.error())};
  }
  for (const slam::MapSurfel& surfel : surfels) {
    const Vector3d& p = surfel.p_map;
    const Vector3d& n = surfel.normal_map;
    fmt::format_to(std::back_inserter(*text), "{:.4f} {:.4f} {:.4f} {:.4f} {:.4f} {:.4f} {:.5f}\n",
                   p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), surfel.sigma_m);
  }
  return write(path, *text);
}

}  // namespace geoflow::tools
