#include "report/course.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "geoflow/hal/pose_estimate.hpp"
#include "geoflow/hal/time.hpp"
#include "geoflow/tools/plot.hpp"

#include "report/run_directory.hpp"

namespace geoflow::tools {
namespace {

using nlohmann::json;

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;
constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
constexpr const char* kTimeLabel = "time since the first pose (s)";
/// Frames further apart than this many times the usual have others between them that have no pose.
constexpr double kGap = 1.5;
constexpr double kPercent = 100;
constexpr int kOneRowPx = 420;

struct StatusColor {
  TrackingStatus status = TrackingStatus::kStarting;
  Color color;
};
constexpr std::array kStatuses{
    StatusColor{.status = TrackingStatus::kTracking, .color = kSeriesColors[2]},
    StatusColor{.status = TrackingStatus::kDegraded, .color = kSeriesColors[1]},
    StatusColor{.status = TrackingStatus::kRelocalising, .color = kSeriesColors[3]}};

double since_first(const RunDirectory& run, std::size_t i) {
  return to_seconds(run.estimates[i].t - run.estimates.front().t);
}

/// The usual time between two estimates [s].
double usual_step(const RunDirectory& run) {
  std::vector<double> steps;
  steps.reserve(run.estimates.size());
  for (std::size_t i = 1; i < run.estimates.size(); ++i) {
    steps.push_back(since_first(run, i) - since_first(run, i - 1));
  }
  if (steps.empty()) {
    return 0;
  }
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::ranges::nth_element(steps, middle);
  return *middle;
}

Series quality_series(const RunDirectory& run, const StatusColor& which, double longest_step) {
  Series series{.label = to_string(which.status), .x = {}, .y = {}, .color = which.color};
  for (std::size_t i = 0; i < run.estimates.size(); ++i) {
    const PoseEstimate& estimate = run.estimates[i];
    const double t = since_first(run, i);
    const bool its = estimate.status == which.status;
    const bool follows = i > 0 && t - since_first(run, i - 1) <= longest_step;
    // A line goes on to the estimate after its last one, so that a single one is seen too.
    const bool ends = follows && run.estimates[i - 1].status == which.status;
    if (its && !follows) {
      series.x.push_back(t);
      series.y.push_back(kNothing);
    }
    series.x.push_back(t);
    series.y.push_back(its || ends ? estimate.quality : kNothing);
  }
  return series;
}

Axes quality_axes(const RunDirectory& run) {
  Axes axes{.title = "Quality, by status",
            .x_label = kTimeLabel,
            .y_label = "quality (0 to 100)",
            .y_from_zero = true};
  for (const StatusColor& status : kStatuses) {
    const bool occurs = std::ranges::find(run.estimates, status.status, &PoseEstimate::status) !=
                        run.estimates.end();
    if (occurs) {
      axes.series.push_back(quality_series(run, status, kGap * usual_step(run)));
    }
  }
  return axes;
}

/// The square root of the covariance's trace over three of its rows.
Axes deviation_axes(const RunDirectory& run, const std::string& title, const std::string& unit,
                    Eigen::Index first_row, double scale) {
  Series series{.label = "", .x = {}, .y = {}};
  for (std::size_t i = 0; i < run.estimates.size(); ++i) {
    const auto diagonal = run.estimates[i].covariance.diagonal();
    series.x.push_back(since_first(run, i));
    series.y.push_back(scale * std::sqrt(diagonal.segment<3>(first_row).sum()));
  }
  return {.title = title,
          .x_label = kTimeLabel,
          .y_label = fmt::format("standard deviation ({})", unit),
          .y_from_zero = true,
          .series = {std::move(series)}};
}

struct Bucket {
  double lower_ms = 0;
  double upper_ms = 0;
  double count = 0;
};

/// Empty where the report's buckets are not as replay writes them.
std::vector<Bucket> read_buckets(const json& list) {
  std::vector<Bucket> buckets;
  for (const json& one : list) {
    const bool three = one.is_array() && one.size() == 3 &&
                       std::ranges::all_of(one, [](const json& v) { return v.is_number(); });
    if (!three || !(one[0] < one[1])) {
      return {};
    }
    buckets.push_back({one[0].get<double>(), one[1].get<double>(), one[2].get<double>()});
  }
  return buckets;
}

/// Which time all but one in a hundred stay below, by buckets.
double most_stay_below(const std::vector<Bucket>& buckets, double total) {
  constexpr double kMost = 0.99;
  double seen = 0;
  for (const Bucket& bucket : buckets) {
    seen += bucket.count;
    if (seen >= kMost * total) {
      return bucket.upper_ms;
    }
  }
  return buckets.back().upper_ms;
}

/// Shares of a range's equal parts as a line of steps: buckets of growing width are shared out.
Series share_steps(const std::vector<Bucket>& buckets, double total, double end_ms) {
  constexpr std::size_t kParts = 40;
  std::vector<double> shares(kParts, 0);
  const double width = end_ms / static_cast<double>(kParts);
  for (const Bucket& bucket : buckets) {
    for (std::size_t i = 0; i < kParts; ++i) {
      const double low = width * static_cast<double>(i);
      const double common = std::min(bucket.upper_ms, low + width) - std::max(bucket.lower_ms, low);
      if (common > 0) {
        shares[i] += kPercent * bucket.count / total * common / (bucket.upper_ms - bucket.lower_ms);
      }
    }
  }
  Series steps{.label = "", .x = {0}, .y = {0}};
  for (std::size_t i = 0; i < kParts; ++i) {
    steps.x.insert(steps.x.end(),
                   {width * static_cast<double>(i), width * (static_cast<double>(i) + 1)});
    steps.y.insert(steps.y.end(), {shares[i], shares[i]});
  }
  return steps;
}

Axes time_axes(const std::string& stage, const std::vector<Bucket>& buckets) {
  constexpr double kRoom = 1.25;
  double total = 0;
  for (const Bucket& bucket : buckets) {
    total += bucket.count;
  }
  return {.title = stage,
          .x_label = "time (ms)",
          .y_label = "share (%)",
          .y_from_zero = true,
          .series = {share_steps(buckets, total, kRoom * most_stay_below(buckets, total))}};
}

}  // namespace

Figure course_figure(const RunDirectory& run) {
  Figure figure{.title = "Status and claimed precision", .columns = 3, .height_px = kOneRowPx};
  figure.axes.push_back(quality_axes(run));
  figure.axes.push_back(deviation_axes(run, "Position in odom", "m", 3, 1));
  figure.axes.push_back(deviation_axes(run, "Orientation in odom", "deg", 0, kDegreesPerRadian));
  return figure;
}

Figure time_figure(const json& report) {
  constexpr int kColumns = 4;
  Figure figure{
      .title = "Times of the stages",
      .subtitle = "share of a run's frames by time, up to a quarter beyond the 99th percentile",
      .columns = kColumns};
  const json histograms = report.value("time_histograms_ms", json::object());
  for (const auto& [stage, list] : histograms.items()) {
    if (const std::vector<Bucket> buckets = read_buckets(list); !buckets.empty()) {
      figure.axes.push_back(time_axes(stage, buckets));
    }
  }
  return figure;
}

}  // namespace geoflow::tools
