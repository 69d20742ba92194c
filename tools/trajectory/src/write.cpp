#include <cstdint>
#include <filesystem>
#include <fstream>
#include <ios>
#include <string>
#include <string_view>

#include <Eigen/Geometry>
#include <fmt/core.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/trajectory.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::tools {
namespace {

constexpr std::string_view kTumHeader = "# timestamp[s] tx ty tz[m] qx qy qz qw\n";

}  // namespace

std::string format_tum_line(const StampedPose& stamped) {
  constexpr std::uint64_t kNanosecondsPerSecond = 1'000'000'000;
  const std::int64_t ns = stamped.t.time_since_epoch().count();
  // Unsigned, because the smallest signed value has no positive counterpart.
  const std::uint64_t magnitude =
      ns < 0 ? ~static_cast<std::uint64_t>(ns) + 1 : static_cast<std::uint64_t>(ns);
  const Vector3d p = stamped.pose.translation();
  Eigen::Quaterniond q = stamped.pose.rotation();
  if (q.w() < 0) {
    q.coeffs() = -q.coeffs();
  }
  return fmt::format("{}{}.{:09} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}",
                     ns < 0 ? "-" : "", magnitude / kNanosecondsPerSecond,
                     magnitude % kNanosecondsPerSecond, p.x(), p.y(), p.z(), q.x(), q.y(), q.z(),
                     q.w());
}

Result<void> write_tum(const std::filesystem::path& path, const Trajectory& poses) {
  std::string text{kTumHeader};
  for (const StampedPose& stamped : poses) {
    text += format_tum_line(stamped);
    text += '\n';
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
