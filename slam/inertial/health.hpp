#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"

#include "inertial/inertial_residual.hpp"

/// Whether the IMU's integration can be believed (paper, section IV-C: "if the IMU pre-integration
/// significantly deviates from the legged odometry or the constant-velocity assumption, indicating
/// IMU integration divergence, we adaptively introduce legged odometry constraints").
namespace geoflow::slam {

/// How far what the IMU predicted lies from what another source says: squared Mahalanobis distance
/// of `dimensions`. Chi-square distributed while both covariances hold.
struct Innovation {
  double squared = 0;
  int dimensions = 0;
};

/// `difference` with its covariance, the sum of both sources'.
template <int Size>
[[nodiscard]] Innovation innovation(const Eigen::Matrix<double, Size, 1>& difference,
                                    const Eigen::Matrix<double, Size, Size>& covariance) {
  return {.squared = difference.dot(covariance.ldlt().solve(difference)), .dimensions = Size};
}

/// Of a pose of the imu (camera and depth, or constant velocity), with the covariance of its right
/// perturbation; and of the imu's velocity in odom (legs). The sources must be independent of what
/// was predicted: a pose that was optimised with the IMU says nothing about it.
[[nodiscard]] Innovation pose_innovation(const UncertainState& predicted, const SE3& T_odom_imu,
                                         const Matrix6d& covariance);
[[nodiscard]] Innovation velocity_innovation(const UncertainState& predicted,
                                             const Vector3d& v_odom, const Matrix3d& covariance);

enum class ImuWitness : std::uint8_t { kCamera, kLegs, kConstantVelocity };
inline constexpr std::size_t kImuWitnesses = 3;

/// Innovations of one frame interval by witness; none where it has nothing to say. They are made
/// with the IMU's own covariance, not the scaled one: else its recovery could not be seen.
using ImuInnovations = std::array<std::optional<Innovation>, kImuWitnesses>;

enum class ImuVerdict : std::uint8_t { kHealthy, kSuspect, kDiverged };

[[nodiscard]] const char* to_string(ImuVerdict verdict) noexcept;

struct ImuJudgement {
  ImuVerdict verdict = ImuVerdict::kHealthy;
  /// What the IMU's covariance is to be multiplied by (>= 1): covariance matching (Mehra, "On the
  /// identification of variances and adaptive Kalman filtering", 1970).
  double variance_scale = 1;
  /// What should predict the next pose: kImu; where that diverged kLegs if they speak, else kNone,
  /// which stands for the rest of the paper's order.
  PoseSource predictor = PoseSource::kImu;
  /// Mean squared innovation per dimension by witness, 1 where the covariances hold; 0: silent.
  std::array<double, kImuWitnesses> mean_squared{};
};

/// Judges the IMU frame by frame. Thread-compatible; deterministic.
///
/// Per witness, innovations per dimension are averaged with forgetting (0.9 a frame: ten frames).
/// A mean above 1 is significant when Wilson and Hilferty's cube-root transform of chi-square
/// (1931) puts it beyond three standard deviations. Then
/// - above 2 the witness doubts: more than the factor to which an IMU's noise is known;
/// - above 9 it contradicts: three times what both covariances explain.
/// It agrees again below 1.5, and a contradiction falls to a doubt below 4 (hysteresis). One
/// innovation counts for at most 50, so that a single shock makes a doubt and no more; a witness
/// that was silent for 0.5 s is forgotten.
///
/// A witness may be wrong itself: legs slip, scenes move. So the IMU has diverged when more
/// witnesses contradict than agree, and is suspect when any doubts. Constant velocity is too weak
/// to agree; only its contradiction counts. The scale is the mean of the best of camera and legs.
class ImuHealth {
 public:
  ImuJudgement update(HostTime t, const ImuInnovations& innovations);

  [[nodiscard]] const ImuJudgement& judgement() const noexcept { return judgement_; }

 private:
  enum class Opinion : std::uint8_t { kSilent, kAgrees, kDoubts, kContradicts };

  /// One witness's record.
  struct Record {
    double sum = 0;             ///< of weighted innovations per dimension
    double weight = 0;          ///< of the weights
    double weight_squared = 0;  ///< of their squares, dimensions divided out
    HostTime last;
    Opinion opinion = Opinion::kSilent;

    void add(const Innovation& innovation);
    [[nodiscard]] double mean() const { return weight > 0 ? sum / weight : 0; }
    [[nodiscard]] bool significant() const;
    void form_opinion();
  };

  [[nodiscard]] ImuVerdict verdict() const;
  [[nodiscard]] double scale() const;

  std::array<Record, kImuWitnesses> records_;
  ImuJudgement judgement_;
};

}  // namespace geoflow::slam
