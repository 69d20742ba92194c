#include "evaluate/table.hpp"

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <numbers>
#include <string>

#include <fmt/core.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/evaluate/evaluation.hpp"

namespace geoflow::tools {
namespace {

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;

}  // namespace

Result<void> write_error_table(const Evaluation& evaluation, const std::filesystem::path& path) {
  std::string text =
      "timestamp_ns,estimate_x_m,estimate_y_m,estimate_z_m,reference_x_m,reference_y_m,"
      "reference_z_m,translation_error_m,rotation_error_deg\n";
  for (std::size_t i = 0; i < evaluation.pairs.size(); ++i) {
    const Vector3d& e = evaluation.pairs[i].estimate.translation();
    const Vector3d& r = evaluation.pairs[i].reference.translation();
    fmt::format_to(std::back_inserter(text),
                   "{},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}\n",
                   evaluation.pairs[i].t.time_since_epoch().count(), e.x(), e.y(), e.z(), r.x(),
                   r.y(), r.z(), evaluation.absolute.translation_m[i],
                   evaluation.absolute.rotation_rad[i] * kDegreesPerRadian);
  }
  std::ofstream stream{path, std::ios::binary | std::ios::trunc};
  stream.write(text.data(), static_cast<std::streamsize>(text.size()));
  stream.close();  // a full disk shows at the latest here
  if (!stream) {
    return fail_errno(path.string());
  }
  return {};
}

}  // namespace geoflow::tools
