#include "src/view.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "geoflow/tools/simulator/camera.hpp"

namespace geoflow::simulator {
namespace {

constexpr double kStep_s = 0.5e-3;
constexpr double kMostSteps = 500;

}  // namespace

ViewTrack::ViewTrack(double begin_s, double end_s, const PoseAt& T_world_cam) : begin_s_{begin_s} {
  const double steps = std::clamp(std::ceil((end_s - begin_s) / kStep_s), 1.0, kMostSteps);
  step_s_ = (end_s - begin_s) / steps;
  for (double step = 0; step <= steps; ++step) {
    views_.emplace_back(T_world_cam(begin_s + step * step_s_));
  }
}

View ViewTrack::at(double t_s) const {
  const double last = static_cast<double>(views_.size() - 1);
  const double place = step_s_ > 0 ? std::clamp((t_s - begin_s_) / step_s_, 0.0, last) : 0.0;
  const auto index = std::min(static_cast<std::size_t>(place), views_.size() - 2);
  const auto share = static_cast<float>(place - static_cast<double>(index));
  const View& before = views_[index];
  const View& after = views_[index + 1];
  View view;
  view.R_world_cam =
      before.R_world_cam + share * Eigen::Matrix3f{after.R_world_cam - before.R_world_cam};
  view.p_world_cam = (1.0F - share) * before.p_world_cam + share * after.p_world_cam;
  return view;
}

ViewTrack::Motion ViewTrack::largest_motion(double duration_s) const {
  const std::size_t last = views_.size() - 1;
  const auto steps =
      step_s_ > 0
          ? std::min(last, static_cast<std::size_t>(std::ceil(std::max(0.0, duration_s) / step_s_)))
          : last;
  Motion motion;
  for (std::size_t i = 0; i + steps <= last; ++i) {
    for (std::size_t k = 1; k <= steps; ++k) {
      const View& from = views_[i];
      const View& to = views_[i + k];
      // The norm of the difference of two rotations is sqrt(8) times the sine of half the angle.
      const float turn_rad =
          (to.R_world_cam - from.R_world_cam).norm() / std::numbers::sqrt2_v<float>;
      motion.turn_rad = std::max(motion.turn_rad, turn_rad);
      motion.shift_m = std::max(motion.shift_m, (to.p_world_cam - from.p_world_cam).norm());
    }
  }
  return motion;
}

}  // namespace geoflow::simulator
