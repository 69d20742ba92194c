#include "vision/dual_stream_flow.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>

#include "geoflow/hal/geometry.hpp"

#include "vision/image_pyramid.hpp"
#include "vision/patch_alignment.hpp"

namespace geoflow::slam {
namespace {

cv::Point2f to_cv(const Vector2d& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y())};
}
Vector2d from_cv(const cv::Point2f& p) {
  return {static_cast<double>(p.x), static_cast<double>(p.y)};
}

struct LucasKanade {
  int window_px;
  int levels;

  /// Moves `to` from its start to where the patches around `from` are found; false where they are
  /// not.
  std::vector<unsigned char> operator()(const ImagePyramid& a, const ImagePyramid& b,
                                        const std::vector<cv::Point2f>& from,
                                        std::vector<cv::Point2f>& to) const {
    constexpr int kIterations = 20;
    constexpr double kStep = 0.03;
    constexpr double kMinimumEigenvalue = 1e-4;
    std::vector<unsigned char> found;
    std::vector<float> error;
    cv::calcOpticalFlowPyrLK(a.levels(), b.levels(), from, to, found, error,
                             cv::Size{window_px, window_px}, levels,
                             {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, kIterations, kStep},
                             cv::OPTFLOW_USE_INITIAL_FLOW, kMinimumEigenvalue);
    return found;
  }
};

}  // namespace

/// What both streams work on, and which of them it is.
struct DualStreamFlow::Stream {
  const ImagePyramid& previous;
  const ImagePyramid& current;
  std::span<const FlowSeed> seeds;
  const LookFor& look_for;
  bool from_prediction;
};

void DualStreamFlow::track_stream(const Stream& stream, const std::vector<std::size_t>& chosen,
                                  std::vector<std::optional<Vector2d>>& tracks) const {
  if (chosen.empty()) {
    return;
  }
  std::vector<cv::Point2f> from;
  std::vector<cv::Point2f> to;
  for (const std::size_t i : chosen) {
    const FlowSeed& seed = stream.seeds[i];
    from.push_back(to_cv(seed.previous));
    to.push_back(
        to_cv(stream.from_prediction ? seed.predicted.value_or(seed.previous) : seed.previous));
  }
  const int levels = stream.from_prediction ? config_.prior_levels : config_.levels;
  // The pyramids' margins are as wide as the wider window.
  const int window_px = stream.from_prediction
                            ? std::min(config_.prior_window_px, config_.window_px)
                            : config_.window_px;
  const auto found = LucasKanade{.window_px = window_px, .levels = levels}(
      stream.previous, stream.current, from, to);

  std::vector<std::size_t> doubtful;
  std::vector<cv::Point2f> from_current;
  std::vector<cv::Point2f> back;
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const std::size_t i = chosen[k];
    if (found[k] == 0 || !camera_.contains(from_cv(to[k]), 1)) {
      continue;
    }
    const PatchSearch search = stream.look_for ? stream.look_for(i, from_cv(to[k])) : PatchSearch{};
    if (search.found()) {
      tracks[i] = search.pixel;
    } else if (search.result == PatchSearch::Result::kUnknown) {
      doubtful.push_back(i);
      from_current.push_back(to[k]);
      back.push_back(from[k]);
    }
  }
  if (doubtful.empty()) {
    return;
  }
  const auto found_back = LucasKanade{.window_px = config_.window_px, .levels = 0}(
      stream.current, stream.previous, from_current, back);
  for (std::size_t k = 0; k < doubtful.size(); ++k) {
    const double off_px = (from_cv(back[k]) - stream.seeds[doubtful[k]].previous).norm();
    if (found_back[k] != 0 && off_px <= config_.forward_backward_px) {
      tracks[doubtful[k]] = from_cv(from_current[k]);
    }
  }
}

void DualStreamFlow::reject_by_epipolar_geometry(
    std::span<const FlowSeed> seeds, std::vector<std::optional<Vector2d>>& tracks) const {
  constexpr std::size_t kEnoughForRansac = 16;  // twice the eight that determine the matrix
  constexpr double kConfidence = 0.99;
  std::vector<std::size_t> index;
  std::vector<cv::Point2f> from;
  std::vector<cv::Point2f> to;
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    if (const std::optional<Vector2d>& track = tracks[i]) {
      index.push_back(i);
      from.push_back(to_cv(camera_.undistort(seeds[i].previous)));
      to.push_back(to_cv(camera_.undistort(*track)));
    }
  }
  if (index.size() < kEnoughForRansac) {
    return;
  }
  std::vector<unsigned char> inlier;
  const cv::Mat fundamental = cv::findFundamentalMat(
      from, to, cv::FM_RANSAC, config_.fundamental_threshold_px, kConfidence, inlier);
  if (fundamental.empty()) {
    return;
  }
  for (std::size_t k = 0; k < index.size(); ++k) {
    if (inlier[k] == 0) {
      tracks[index[k]].reset();
    }
  }
}

void DualStreamFlow::reject_double_occupancy(std::vector<std::optional<Vector2d>>& tracks) const {
  constexpr int kCellPx = 4;
  const int columns = camera_.intrinsics().width / kCellPx + 1;
  const int rows = camera_.intrinsics().height / kCellPx + 1;
  cv::Mat1b occupied(rows, columns, static_cast<unsigned char>(0));
  for (auto& track : tracks) {
    if (!track) {
      continue;
    }
    unsigned char& cell =
        occupied(static_cast<int>(track->y()) / kCellPx, static_cast<int>(track->x()) / kCellPx);
    if (cell != 0) {
      track.reset();
    }
    cell = 1;
  }
}

std::vector<std::optional<Vector2d>> DualStreamFlow::track(const ImagePyramid& previous,
                                                           const ImagePyramid& current,
                                                           std::span<const FlowSeed> seeds,
                                                           const LookFor& look_for) const {
  std::vector<std::optional<Vector2d>> tracks(seeds.size());
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    const std::optional<Vector2d>& predicted = seeds[i].predicted;
    if (predicted && camera_.contains(*predicted, 1)) {
      chosen.push_back(i);
    }
  }
  Stream stream{.previous = previous,
                .current = current,
                .seeds = seeds,
                .look_for = look_for,
                .from_prediction = true};
  track_stream(stream, chosen, tracks);
  chosen.clear();
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    if (!tracks[i]) {
      chosen.push_back(i);
    }
  }
  stream.from_prediction = false;
  track_stream(stream, chosen, tracks);
  reject_by_epipolar_geometry(seeds, tracks);
  reject_double_occupancy(tracks);
  return tracks;
}

}  // namespace geoflow::slam
