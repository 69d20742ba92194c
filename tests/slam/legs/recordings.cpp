#include "recordings.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::tests {
namespace {

/// Where Go1's rows (FL, FR, RL, RR) stand in the SDK's order.
constexpr std::array<std::size_t, kLegCount> kSdkOfGo1Row{1, 0, 3, 2};
/// Rows of the Go1's joint rates that differentiation spoilt.
constexpr std::size_t kSpoiltRows = 3;

using Table = std::vector<std::vector<double>>;

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells;
  std::size_t begin = 0;
  while (begin <= line.size()) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    cells.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return cells;
}

/// The numbers of a csv file with one line of names.
Table read_table(const std::filesystem::path& path) {
  std::ifstream file{path};
  std::string line;
  std::getline(file, line);
  const std::size_t columns = split(line).size();
  Table table;
  while (std::getline(file, line)) {
    std::vector<double> row;
    for (const std::string& cell : split(line)) {
      row.push_back(std::stod(cell));
    }
    if (row.size() != columns) {
      throw std::runtime_error{path.string() + ": a row of another length"};
    }
    table.push_back(std::move(row));
  }
  return table;
}

Vector3d vector_at(const std::vector<double>& row, std::size_t column) {
  return {row.at(column), row.at(column + 1), row.at(column + 2)};
}

Eigen::Quaterniond from_euler(const Vector3d& xyz) {
  return Eigen::AngleAxisd{xyz.z(), Vector3d::UnitZ()} *
         Eigen::AngleAxisd{xyz.y(), Vector3d::UnitY()} *
         Eigen::AngleAxisd{xyz.x(), Vector3d::UnitX()};
}

}  // namespace

HostTime at_seconds(double seconds) {
  return HostTime{from_seconds(seconds)};
}

SE3 WalkRecording::truth_at(HostTime t) const {
  const auto next = std::ranges::lower_bound(truth, t, {}, &Timed<SE3>::t);
  return next == truth.end() ? truth.back().sample : next->sample;
}

double WalkRecording::path_m(HostTime from, HostTime to) const {
  constexpr Duration kStep = std::chrono::milliseconds{100};
  double length = 0;
  for (HostTime t = from; t + kStep <= to; t += kStep) {
    length += (truth_at(t + kStep).translation() - truth_at(t).translation()).norm();
  }
  return length;
}

WalkRecording read_go1_walk(const std::filesystem::path& folder) {
  const Table accel = read_table(folder / "Accel_body_IMU.csv");
  const Table gyro = read_table(folder / "Gyro_body_IMU.csv");
  const Table angle = read_table(folder / "Joint_ang.csv");
  const Table rate = read_table(folder / "Joint_vel.csv");
  const Table contact = read_table(folder / "Contact_mode.csv");
  const Table position = read_table(folder / "Pos_mocap.csv");
  const Table euler = read_table(folder / "Orient_mocap_euler.csv");
  WalkRecording recording;
  for (std::size_t row = 0; row < accel.size(); ++row) {
    const HostTime t = at_seconds(accel[row][0]);
    LegSample legs;
    std::array<bool, kLegCount> stands{};
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      const std::size_t sdk = kSdkOfGo1Row.at(leg);
      for (std::size_t joint = 0; joint < kJointsPerLeg; ++joint) {
        const std::size_t column = 1 + leg * kJointsPerLeg + joint;
        JointState& state = legs.joints.at(sdk * kJointsPerLeg + joint);
        state.q_rad = angle.at(row).at(column);
        state.dq_radps = row < kSpoiltRows ? 0.0 : rate.at(row).at(column);
      }
      legs.valid.at(sdk) = true;
      stands.at(sdk) = contact.at(row).at(1 + leg) > 0.5;
    }
    recording.imu.push_back({.t = t,
                             .sample = {.accel_mps2 = vector_at(accel[row], 1),
                                        .gyro_radps = vector_at(gyro.at(row), 1)}});
    recording.legs.push_back({.t = t, .sample = legs});
    recording.truth.push_back(
        {.t = t,
         .sample = SE3{from_euler(vector_at(euler.at(row), 1)), vector_at(position.at(row), 1)}});
    recording.contacts.push_back(stands);
  }
  return recording;
}

WalkRecording read_go2_trot(const std::filesystem::path& file) {
  // t, position 3, quaternion w x y z, velocity 3, gyroscope 3, accelerometer 3, then 12 angles,
  // rates and torques and 4 forces.
  constexpr std::size_t kPosition = 1;
  constexpr std::size_t kQuaternion = 4;
  constexpr std::size_t kGyro = 11;
  constexpr std::size_t kAccel = 14;
  constexpr std::size_t kAngle = 17;
  constexpr std::size_t kJoints = kLegCount * kJointsPerLeg;
  constexpr double kTouchN = 5;  // of the simulated force
  WalkRecording recording;
  for (const std::vector<double>& row : read_table(file)) {
    const HostTime t = at_seconds(row.at(0));
    LegSample legs;
    for (std::size_t joint = 0; joint < kJoints; ++joint) {
      legs.joints.at(joint) = {.q_rad = row.at(kAngle + joint),
                               .dq_radps = row.at(kAngle + kJoints + joint),
                               .tau_nm = row.at(kAngle + 2 * kJoints + joint)};
    }
    std::array<bool, kLegCount> stands{};
    for (std::size_t leg = 0; leg < kLegCount; ++leg) {
      const double force = row.at(kAngle + 3 * kJoints + leg);
      legs.foot_force.at(leg) = static_cast<float>(force);
      legs.valid.at(leg) = true;
      stands.at(leg) = force > kTouchN;
    }
    const Eigen::Quaterniond q{row.at(kQuaternion), row.at(kQuaternion + 1),
                               row.at(kQuaternion + 2), row.at(kQuaternion + 3)};
    recording.imu.push_back(
        {.t = t,
         .sample = {.accel_mps2 = vector_at(row, kAccel), .gyro_radps = vector_at(row, kGyro)}});
    recording.legs.push_back({.t = t, .sample = legs});
    recording.truth.push_back({.t = t, .sample = SE3{q, vector_at(row, kPosition)}});
    recording.contacts.push_back(stands);
  }
  return recording;
}

LegSample read_go2_snapshot(const std::filesystem::path& file, std::string_view pose) {
  constexpr std::size_t kIndex = 1;
  constexpr std::size_t kAngle = 3;
  LegSample sample;
  sample.valid.fill(true);
  std::ifstream stream{file};
  for (std::string line; std::getline(stream, line);) {
    const std::vector<std::string> cells = split(line);
    if (cells.front() == pose) {
      sample.joints.at(std::stoul(cells.at(kIndex))) = {.q_rad = std::stod(cells.at(kAngle)),
                                                        .dq_radps = std::stod(cells.at(kAngle + 1)),
                                                        .tau_nm = std::stod(cells.at(kAngle + 2))};
    }
  }
  return sample;
}

}  // namespace geoflow::tests
