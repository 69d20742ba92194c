#include "src/view.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "geoflow/tools/simulator/camera.hpp"

namespace geoflow::simulator {
namespace {

constexpr double kStep_s = 1e-3;
constexpr int kMostSteps = 250;

}  // namespace

ViewTrack::ViewTrack(double begin_s, double end_s, const PoseAt& T_world_cam) : begin_s_{begin_s} {
  const int steps =
      static_cast<int>(std::clamp<double>(std::ceil((end_s - begin_s) / kStep_s), 1, kMostSteps));
  step_s_ = (end_s - begin_s) / steps;
  for (int step = 0; step <= steps; ++step) {
    views_.emplace_back(T_world_cam(begin_s + step * step_s_));
  }
}

View ViewTrack::at(double t_s) const {
  const auto last = static_cast<double>(views_.size() - 1);
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

}  // namespace geoflow::simulator
