#include "cloud/gicp_search.hpp"

#include "geoflow/hal/geometry.hpp"

#include "cloud/depth_cloud.hpp"
#include "cloud/gicp.hpp"

namespace geoflow::slam {

RegistrationResult register_from_afar(const DepthCloud& source, const DepthCloud& target,
                                      const SE3& T_target_source_guess, const GicpConfig& config) {
  constexpr double kStepM = 0.2;
  constexpr double kStepRad = 0.15;
  RegistrationResult best = register_clouds(source, target, T_target_source_guess, config);
  const auto attempt = [&](const SE3& guess) {
    if (best.overlap < kGoodOverlap || !best.converged) {
      const RegistrationResult result = register_clouds(source, target, guess, config);
      if (result.converged && (!best.converged || result.overlap > best.overlap)) {
        best = result;
      }
    }
  };
  attempt(SE3{});
  for (int axis = 0; axis < 6; ++axis) {
    const double step = axis < 3 ? kStepRad : kStepM;
    attempt(SE3::exp(step * Vector6d::Unit(axis)));
    attempt(SE3::exp(-step * Vector6d::Unit(axis)));
  }
  return best;
}

}  // namespace geoflow::slam
