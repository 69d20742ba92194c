#include "geoflow/tools/simulator/truth_files.hpp"

#include <cstdint>
#include <filesystem>
#include <ios>
#include <iterator>
#include <string>
#include <utility>

#include <fmt/core.h>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/tools/simulator/body_trajectory.hpp"
#include "geoflow/tools/simulator/simulation.hpp"
#include "geoflow/tools/trajectory_file.hpp"

namespace geoflow::simulator {
namespace {

constexpr const char* kTable = "truth.csv";

constexpr const char* kHeader =
    "t_s,px_m,py_m,pz_m,qx,qy,qz,qw,vx_mps,vy_mps,vz_mps,wx_radps,wy_radps,wz_radps,"
    "bias_ax_mps2,bias_ay_mps2,bias_az_mps2,bias_gx_radps,bias_gy_radps,bias_gz_radps,imu_faulty,"
    "contact_fr,contact_fl,contact_rr,contact_rl,slip_fr,slip_fl,slip_rr,slip_rl,"
    "slip_fr_mps,slip_fl_mps,slip_rr_mps,slip_rl_mps\n";

void append(std::string& line, const Vector3d& v) {
  fmt::format_to(std::back_inserter(line), ",{:.9g},{:.9g},{:.9g}", v.x(), v.y(), v.z());
}

std::string line_of(const TruthSample& sample) {
  constexpr std::int64_t kNanoseconds = 1'000'000'000;
  const std::int64_t ns = sample.t.time_since_epoch().count();
  std::string line = fmt::format("{}.{:09}", ns / kNanoseconds, ns % kNanoseconds);
  const BodyState& body = sample.body;
  const Eigen::Quaterniond& q = body.T_world_base.rotation();
  append(line, body.T_world_base.translation());
  append(line, q.vec());
  fmt::format_to(std::back_inserter(line), ",{:.9g}", q.w());
  append(line, body.v_world_base);
  append(line, body.w_base);
  append(line, sample.imu.accel_bias_mps2);
  append(line, sample.imu.gyro_bias_radps);
  fmt::format_to(std::back_inserter(line), ",{:d}", static_cast<int>(sample.imu.faulty));
  for (const bool contact : sample.legs.contact) {
    fmt::format_to(std::back_inserter(line), ",{:d}", static_cast<int>(contact));
  }
  for (const bool slipping : sample.legs.slipping) {
    fmt::format_to(std::back_inserter(line), ",{:d}", static_cast<int>(slipping));
  }
  for (const Vector3d& velocity : sample.legs.contact_mps) {
    fmt::format_to(std::back_inserter(line), ",{:.9g}", velocity.norm());
  }
  return line + "\n";
}

}  // namespace

TruthFiles::TruthFiles(std::filesystem::path directory)
    : directory_{std::move(directory)},
      table_{directory_ / kTable, std::ios::binary | std::ios::trunc} {
  table_ << kHeader;
}

void TruthFiles::add(const FrameTruth& frame) {
  camera_.push_back({frame.t, frame.T_world_cam});
  base_.push_back({frame.t, frame.T_world_base});
}

void TruthFiles::add(const TruthSample& sample) {
  table_ << line_of(sample);
}

Result<void> TruthFiles::close() {
  table_.close();
  if (!table_) {
    return fail(ErrorCode::kSystem, "{}: cannot be written", (directory_ / kTable).string());
  }
  return tools::write_tum(directory_ / "groundtruth.txt", camera_).and_then([&] {
    return tools::write_tum(directory_ / "groundtruth_base.txt", base_);
  });
}

}  // namespace geoflow::simulator
