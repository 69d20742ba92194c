#include "geoflow/calibration/imu_intrinsics.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <fmt/core.h>
#include <fmt/format.h>
#include <tl/expected.hpp>

#include "geoflow/calibration/finding.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "imu/still_stretch.hpp"
#include "imu/uniform_series.hpp"

namespace geoflow::calibration {
namespace {

constexpr std::size_t kFewestPoses = 12;
constexpr double kDegree = std::numbers::pi / 180;

using Parameters = Eigen::Matrix<double, kAccelParameters, 1>;
using Normal = Eigen::Matrix<double, kAccelParameters, kAccelParameters>;

/// Where correction's six parameters stand.
constexpr std::array<std::pair<Eigen::Index, Eigen::Index>, 6> kEntries{
    {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
constexpr Eigen::Index kBiasAt = 6;
constexpr std::array<const char*, 3> kLetters{"x", "y", "z"};

/// Parts of a rest whose means say how sure its mean is.
constexpr std::size_t kParts = 4;

/// Mean of values [begin, end), and its standard deviation by the spread of its parts' means: a
/// slow change counts, where the samples' own scatter would hide it.
std::pair<double, double> mean_and_sigma(std::span<const double> values) {
  std::array<double, kParts> parts{};
  double mean = 0;
  const std::size_t length = values.size() / kParts;
  for (std::size_t part = 0; part < kParts; ++part) {
    double sum = 0;
    for (const double value : values.subspan(part * length, length)) {
      sum += value;
    }
    parts.at(part) = sum / static_cast<double>(length);
    mean += parts.at(part) / static_cast<double>(kParts);
  }
  double squares = 0;
  for (const double part : parts) {
    squares += (part - mean) * (part - mean);
  }
  return {mean, std::sqrt(squares / static_cast<double>(kParts * (kParts - 1)))};
}

ImuPose pose_of(const UniformRecording& recording, const StillStretch& stretch) {
  const UniformSeries& series = recording.pieces[stretch.piece];
  ImuPose pose{
      .begin = series.begin + from_seconds(static_cast<double>(stretch.begin) * recording.period_s),
      .length = from_seconds(static_cast<double>(stretch.size()) * recording.period_s)};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto row = static_cast<Eigen::Index>(axis);
    const auto values = [&](std::size_t which) {
      return std::span{series.axes.at(which)}.subspan(stretch.begin, stretch.size());
    };
    std::tie(pose.mean.accel_mps2[row], pose.accel_sigma_mps2[row]) = mean_and_sigma(values(axis));
    std::tie(pose.mean.gyro_radps[row], pose.gyro_sigma_radps[row]) =
        mean_and_sigma(values(axis + 3));
  }
  return pose;
}

std::vector<ImuPose> find_poses(const UniformRecording& recording, double min_still_s) {
  std::vector<ImuPose> poses;
  for (const StillStretch& stretch : still_stretches(recording)) {
    if (static_cast<double>(stretch.size()) * recording.period_s >= min_still_s) {
      poses.push_back(pose_of(recording, stretch));
    }
  }
  return poses;
}

/// The usual size of a pose's uncertainty along its reading; single ones, of so few parts, are too
/// uncertain themselves to be weights.
double usual_sigma(std::span<const ImuPose> poses) {
  std::vector<double> sigmas;
  for (const ImuPose& pose : poses) {
    sigmas.push_back(pose.accel_sigma_mps2.norm() / std::numbers::sqrt3);
  }
  const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
  std::ranges::nth_element(sigmas, middle);
  return *middle;
}

AccelIntrinsics moved(AccelIntrinsics from, const Parameters& step) {
  for (std::size_t i = 0; i < kEntries.size(); ++i) {
    from.correction(kEntries.at(i).first, kEntries.at(i).second) +=
        step[static_cast<Eigen::Index>(i)];
  }
  from.bias_mps2 += step.tail<3>();
  return from;
}

double length_error(const AccelIntrinsics& accel, const Vector3d& reading, double gravity_mps2) {
  return (accel.correction * (reading - accel.bias_mps2)).norm() - gravity_mps2;
}

/// Derivative of the corrected reading's length.
Parameters derivative(const AccelIntrinsics& accel, const Vector3d& reading) {
  const Vector3d unbiased = reading - accel.bias_mps2;
  const Vector3d direction = (accel.correction * unbiased).normalized();
  Parameters by;
  for (std::size_t i = 0; i < kEntries.size(); ++i) {
    by[static_cast<Eigen::Index>(i)] =
        direction[kEntries.at(i).first] * unbiased[kEntries.at(i).second];
  }
  by.tail<3>() = -accel.correction.transpose() * direction;
  return by;
}

Normal normal_matrix(std::span<const ImuPose> poses, const AccelIntrinsics& accel) {
  Normal normal = Normal::Zero();
  for (const ImuPose& pose : poses) {
    const Parameters by = derivative(accel, pose.mean.accel_mps2);
    normal += by * by.transpose();
  }
  return normal;
}

AccelIntrinsics fit_accel(std::span<const ImuPose> poses, double gravity_mps2) {
  constexpr int kIterations = 12;
  AccelIntrinsics accel;
  for (int i = 0; i < kIterations; ++i) {
    Parameters gradient = Parameters::Zero();
    for (const ImuPose& pose : poses) {
      gradient += derivative(accel, pose.mean.accel_mps2) *
                  length_error(accel, pose.mean.accel_mps2, gravity_mps2);
    }
    accel = moved(accel, -normal_matrix(poses, accel).ldlt().solve(gradient));
  }
  return accel;
}

/// What to do so that the parameters are determined; empty where they are.
std::string missing_orientations(std::span<const ImuPose> poses, double gravity_mps2) {
  // Bias and scale of an axis need it both up and down, two axes' angle both between them.
  constexpr double kUp = 0.6;
  constexpr double kBetween = 0.25;
  std::vector<std::string> missing;
  const auto any = [&](auto&& fits) {
    return std::ranges::any_of(poses, [&](const ImuPose& pose) {
      return fits(Vector3d{pose.mean.accel_mps2 / gravity_mps2});
    });
  };
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      if (!any([&](const Vector3d& up) { return sign * up[axis] > kUp; })) {
        missing.push_back(fmt::format("with {} {}", kLetters.at(static_cast<std::size_t>(axis)),
                                      sign > 0 ? "up" : "down"));
      }
    }
  }
  for (Eigen::Index a = 0; a < 3; ++a) {
    const Eigen::Index b = (a + 1) % 3;
    const auto between = [&](double sign) {
      return any([&](const Vector3d& up) { return sign * up[a] * up[b] > kBetween; });
    };
    if (!between(1) && !between(-1)) {
      missing.push_back(fmt::format("tilted between {} and {}",
                                    kLetters.at(static_cast<std::size_t>(a)),
                                    kLetters.at(static_cast<std::size_t>(b))));
    }
  }
  return fmt::format("{}", fmt::join(missing, ", "));
}

Result<void> check_coverage(std::span<const ImuPose> poses, const ImuIntrinsicsOptions& options) {
  if (poses.size() < kFewestPoses) {
    return fail(ErrorCode::kInvalidData,
                "it lies still {} times for {} s or more, {} are needed: lay it down on all its "
                "sides and edges in turn, some seconds each",
                poses.size(), options.min_still_s, kFewestPoses);
  }
  const std::string missing = missing_orientations(poses, options.gravity_mps2);
  if (!missing.empty()) {
    return fail(ErrorCode::kInvalidData, "orientations are missing: {}", missing);
  }
  // Lengths near gravity tell the parameters apart only if the poses do not lie on a plane or a
  // cone.
  constexpr double kFlattest = 1e-4;
  const Normal normal = normal_matrix(poses, {}) / std::pow(options.gravity_mps2, 2);
  Parameters scale = Parameters::Ones();
  scale.tail<3>().setConstant(options.gravity_mps2);
  const Eigen::SelfAdjointEigenSolver<Normal> solver{scale.asDiagonal() * normal *
                                                     scale.asDiagonal()};
  if (solver.eigenvalues()[0] < kFlattest * solver.eigenvalues()[kAccelParameters - 1]) {
    return fail(ErrorCode::kInvalidData,
                "its {} poses are too much alike to tell the parameters apart: add others, tilted "
                "between the axes",
                poses.size());
  }
  return {};
}

/// Gyroscope by linear least squares over (1, specific force).
void fit_gyro(ImuIntrinsicsEstimate& estimate) {
  constexpr Eigen::Index kColumns = 4;
  const auto rows = static_cast<Eigen::Index>(estimate.poses.size());
  Eigen::MatrixX4d design(rows, kColumns);
  Eigen::MatrixX3d values(rows, 3);
  for (Eigen::Index row = 0; row < rows; ++row) {
    const ImuPose& pose = estimate.poses[static_cast<std::size_t>(row)];
    design(row, 0) = 1;
    design.row(row).tail<3>() =
        estimate.accel.correction * (pose.mean.accel_mps2 - estimate.accel.bias_mps2);
    values.row(row) = pose.mean.gyro_radps;
  }
  const Eigen::Matrix4d inverse = (design.transpose() * design).inverse();
  const Eigen::Matrix<double, kColumns, 3> solution = inverse * design.transpose() * values;
  const Eigen::MatrixX3d residuals = values - design * solution;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double variance =
        residuals.col(axis).squaredNorm() / static_cast<double>(rows - kColumns);
    estimate.gyro.bias_radps[axis] = solution(0, axis);
    estimate.gyro_bias_sigma_radps[axis] = std::sqrt(variance * inverse(0, 0));
    for (Eigen::Index by = 0; by < 3; ++by) {
      estimate.gyro.per_accel(axis, by) = solution(by + 1, axis);
      estimate.gyro_per_accel_sigma(axis, by) = std::sqrt(variance * inverse(by + 1, by + 1));
    }
  }
}

struct Bar {
  double pass_sigma;  ///< known no worse than this
  double usual;       ///< no larger than this
};
constexpr Bar kScaleBar{.pass_sigma = 1e-3, .usual = 0.03};
constexpr Bar kAngleBar{.pass_sigma = 0.1 * kDegree, .usual = 2 * kDegree};
constexpr Bar kAccelBiasBar{.pass_sigma = 0.02, .usual = 0.5};
constexpr Bar kGyroBiasBar{.pass_sigma = 5e-4, .usual = 0.05};
constexpr Bar kPerAccelBar{.pass_sigma = 1e-4, .usual = 2e-3};

Finding judged(std::string name, double value, double sigma, const char* unit, const Bar& bar) {
  Finding finding{.name = std::move(name), .value = value, .sigma = sigma, .unit = unit};
  if (sigma > bar.pass_sigma) {
    finding.verdict = Verdict::kWarn;
    finding.note =
        fmt::format("known to {:.2g} only, {:.2g} is asked for: more poses, longer rests", sigma,
                    bar.pass_sigma);
  } else if (std::abs(value) > bar.usual) {
    finding.verdict = Verdict::kWarn;
    finding.note = fmt::format("unusually large: more than {:.2g}", bar.usual);
  }
  return finding;
}

Finding judge_residual(const ImuIntrinsicsEstimate& estimate, double gravity_mps2) {
  constexpr double kGood = 5e-3;  // of gravity
  constexpr double kBad = 2e-2;
  const double relative = estimate.rms_after_mps2 / gravity_mps2;
  Finding finding{.name = "accel.residual",
                  .value = relative,
                  .sigma = relative / std::sqrt(2.0 * static_cast<double>(estimate.poses.size())),
                  .unit = "of gravity"};
  if (relative > kGood) {
    finding.verdict = relative > kBad ? Verdict::kFail : Verdict::kWarn;
    finding.note =
        "corrected readings at rest are not as long as gravity: it did not lie still, "
        "or its errors are not of this kind";
  }
  return finding;
}

}  // namespace

Result<ImuIntrinsicsEstimate> estimate_imu_intrinsics(std::span<const Timed<ImuSample>> samples,
                                                      const ImuIntrinsicsOptions& options) {
  const auto recording = make_uniform(samples);
  if (!recording) {
    return tl::unexpected{recording.error()};
  }
  ImuIntrinsicsEstimate estimate;
  estimate.poses = find_poses(*recording, options.min_still_s);
  if (auto covered = check_coverage(estimate.poses, options); !covered) {
    return tl::unexpected{covered.error()};
  }
  estimate.accel = fit_accel(estimate.poses, options.gravity_mps2);
  double squares = 0;
  for (const ImuPose& pose : estimate.poses) {
    const Vector3d& reading = pose.mean.accel_mps2;
    estimate.before_mps2.push_back(reading.norm() - options.gravity_mps2);
    estimate.after_mps2.push_back(length_error(estimate.accel, reading, options.gravity_mps2));
    squares += std::pow(estimate.after_mps2.back(), 2);
  }
  const auto count = static_cast<double>(estimate.poses.size());
  estimate.rms_after_mps2 = std::sqrt(squares / count);
  // What the rests' own scatter says, or what is left over where that is more: the bias wanders
  // from rest to rest.
  const double variance =
      std::max(std::pow(usual_sigma(estimate.poses), 2), squares / (count - kAccelParameters));
  estimate.accel_covariance = variance * normal_matrix(estimate.poses, estimate.accel).inverse();
  fit_gyro(estimate);
  return estimate;
}

std::vector<Finding> judge(const ImuIntrinsicsEstimate& estimate,
                           const ImuIntrinsicsOptions& options) {
  std::vector<Finding> findings{judge_residual(estimate, options.gravity_mps2)};
  const Parameters sigma = estimate.accel_covariance.diagonal().cwiseSqrt();
  for (std::size_t i = 0; i < kEntries.size(); ++i) {
    const auto [row, column] = kEntries.at(i);
    const double entry = estimate.accel.correction(row, column);
    const char* first = kLetters.at(static_cast<std::size_t>(row));
    const char* second = kLetters.at(static_cast<std::size_t>(column));
    const double own = sigma[static_cast<Eigen::Index>(i)];
    findings.push_back(row == column ? judged(fmt::format("accel.scale_error_{}", first), entry - 1,
                                              own, "1", kScaleBar)
                                     : judged(fmt::format("accel.misalignment_{}{}", first, second),
                                              entry, own, "rad", kAngleBar));
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const char* letter = kLetters.at(static_cast<std::size_t>(axis));
    findings.push_back(judged(fmt::format("accel.bias_{}", letter), estimate.accel.bias_mps2[axis],
                              sigma[kBiasAt + axis], "m/s^2", kAccelBiasBar));
    findings.push_back(judged(fmt::format("gyro.bias_{}", letter), estimate.gyro.bias_radps[axis],
                              estimate.gyro_bias_sigma_radps[axis], "rad/s", kGyroBiasBar));
    for (Eigen::Index by = 0; by < 3; ++by) {
      findings.push_back(judged(
          fmt::format("gyro.per_accel_{}{}", letter, kLetters.at(static_cast<std::size_t>(by))),
          estimate.gyro.per_accel(axis, by), estimate.gyro_per_accel_sigma(axis, by),
          "rad/s per m/s^2", kPerAccelBar));
    }
  }
  return findings;
}

}  // namespace geoflow::calibration
