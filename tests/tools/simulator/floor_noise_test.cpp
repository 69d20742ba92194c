#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/tools/simulator/camera.hpp"
#include "geoflow/tools/simulator/random.hpp"
#include "geoflow/tools/simulator/scene.hpp"
#include "tests/support/data.hpp"

#include "camera_rig.hpp"
#include "src/infrared_view.hpp"
#include "src/lighting.hpp"
#include "src/ray_scene.hpp"
#include "src/shader.hpp"
#include "src/stereo.hpp"

/// Depth of a floor, simulated and recorded by a D435, through one estimator of noise and holes.
namespace geoflow::simulator::tests {
namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 480;
constexpr int kBlock = 16;     // pixels
constexpr int kBeside_px = 8;  // where the model's correlation is a half
constexpr int kBelow_px = 6;

/// An image of disparity [px], row by row; 0: no measurement.
using Disparity = std::vector<double>;

double at(const Disparity& image, int x, int y) {
  return image[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)];
}

/// The disparity of a plane is linear in the image: (x, y, 1) . coefficients.
double on_plane(const Vector3d& plane, int x, int y) {
  return plane.dot(Vector3d{static_cast<double>(x), static_cast<double>(y), 1});
}

/// The plane that most of the image's lower part lies on, if three fifths do: RANSAC, then least
/// squares of what is within 0.4 px.
std::optional<Vector3d> find_floor(const Disparity& image) {
  struct Point {
    Vector3d place;
    double disparity;
  };
  std::vector<Point> points;
  for (int y = kHeight * 2 / 5; y < kHeight; y += 5) {
    for (int x = 0; x < kWidth; x += 5) {
      if (at(image, x, y) > 0) {
        points.push_back(
            {Vector3d{static_cast<double>(x), static_cast<double>(y), 1}, at(image, x, y)});
      }
    }
  }
  const auto near = [&](const Vector3d& plane) {
    return std::ranges::count_if(points, [&](const Point& point) {
      return std::abs(plane.dot(point.place) - point.disparity) < 0.4;
    });
  };
  Random random{1, "floor"};
  const auto count = static_cast<int>(points.size());
  std::optional<Vector3d> best;
  std::ptrdiff_t most = 0;
  for (int attempt = 0; count > 1000 && attempt < 100; ++attempt) {
    Matrix3d places;
    Vector3d disparities;
    for (int i = 0; i < 3; ++i) {
      const Point& point = points[static_cast<std::size_t>(random.index(count))];
      places.row(i) = point.place;
      disparities[i] = point.disparity;
    }
    const Vector3d plane = places.fullPivLu().solve(disparities);
    if (const std::ptrdiff_t on = near(plane); on > most) {
      most = on;
      best = plane;
    }
  }
  if (most < count * 3 / 5) {
    return std::nullopt;
  }
  Matrix3d normal = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const Point& point : points) {
    if (std::abs(best->dot(point.place) - point.disparity) < 0.4) {
      normal += point.place * point.place.transpose();
      right += point.disparity * point.place;
    }
  }
  return normal.ldlt().solve(right);
}

/// A range of distances, and what the floor in it shows.
struct Band {
  double from_m;
  double to_m;
  std::vector<double> deviations_px{};  ///< from the plane, of each block
  double squares = 0;
  double beside = 0;  ///< products of neighbours at kBeside_px, and at kBelow_px
  double below = 0;
  std::size_t measured = 0;
  std::size_t pixels = 0;

  [[nodiscard]] double deviation_px() {
    std::ranges::sort(deviations_px);
    return deviations_px.at(deviations_px.size() / 2);
  }
  [[nodiscard]] double holes() const {
    return 1 - static_cast<double>(measured) / static_cast<double>(pixels);
  }
  [[nodiscard]] double correlation_beside() const { return beside / squares; }
  [[nodiscard]] double correlation_below() const { return below / squares; }
};
using Bands = std::array<Band, 4>;

Bands bands() {
  return {{{.from_m = 0.75, .to_m = 1.25},
           {.from_m = 1.25, .to_m = 1.75},
           {.from_m = 1.75, .to_m = 2.5},
           {.from_m = 2.5, .to_m = 3.5}}};
}

/// Adds one block of the image that is floor: nearly nothing in it lies off the plane by a pixel,
/// and at least two fifths of it are measured.
void add_block(const Disparity& image, const Vector3d& plane, int left, int top, Band& band) {
  const auto error = [&](int x, int y) {
    return at(image, x, y) > 0 ? at(image, x, y) - on_plane(plane, x, y) : 0.0;
  };
  std::size_t measured = 0;
  std::size_t off = 0;
  double squares = 0;
  double beside = 0;
  double below = 0;
  for (int y = top; y < top + kBlock; ++y) {
    for (int x = left; x < left + kBlock; ++x) {
      measured += at(image, x, y) > 0 ? 1U : 0U;
      off += std::abs(error(x, y)) > 1 ? 1U : 0U;
      squares += error(x, y) * error(x, y);
      beside += error(x, y) * error(x + kBeside_px, y);
      below += error(x, y) * error(x, y + kBelow_px);
    }
  }
  constexpr std::size_t kPixels = std::size_t{kBlock} * kBlock;
  if (measured < kPixels * 2 / 5 || off > kPixels / 50) {
    return;
  }
  band.deviations_px.push_back(std::sqrt(squares / static_cast<double>(measured)));
  band.squares += squares;
  band.beside += beside;
  band.below += below;
  band.measured += measured;
  band.pixels += kPixels;
}

/// Takes an image in; one without a floor says nothing.
void add_image(const Disparity& image, double focal_baseline, Bands& bands) {
  constexpr int kLeft = 2 * kBlock;  // what the right camera does not see
  const std::optional<Vector3d> plane = find_floor(image);
  if (!plane) {
    return;
  }
  for (int top = 0; top + 2 * kBlock <= kHeight; top += kBlock) {
    for (int left = kLeft; left + 2 * kBlock <= kWidth; left += kBlock) {
      const double z_m = focal_baseline / on_plane(*plane, left + kBlock / 2, top + kBlock / 2);
      for (Band& band : bands) {
        if (z_m >= band.from_m && z_m < band.to_m) {
          add_block(image, *plane, left, top, band);
        }
      }
    }
  }
}

Bands recorded_floor(const std::filesystem::path& folder) {
  constexpr double kFocalBaseline = 383.8 * kD435iBaseline_m;
  Bands seen = bands();
  std::vector<std::filesystem::path> files;
  for (const auto& file : std::filesystem::directory_iterator{folder / "depth"}) {
    files.push_back(file.path());
  }
  std::ranges::sort(files);
  for (std::size_t i = 0; i < files.size(); i += 6) {
    const cv::Mat millimetres = cv::imread(files[i].string(), cv::IMREAD_UNCHANGED);
    EXPECT_EQ(millimetres.type(), CV_16UC1) << files[i];
    Disparity image(std::size_t{kWidth} * kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto depth_mm = millimetres.at<std::uint16_t>(y, x);
        image[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)] =
            depth_mm > 0 ? 1e3 * kFocalBaseline / depth_mm : 0;
      }
    }
    add_image(image, kFocalBaseline, seen);
  }
  return seen;
}

/// Seen as the recording sees its floor: from 0.63 m, 20 degrees downwards.
Bands simulated_floor() {
  constexpr double kPitchRad = 0.356;
  constexpr float kCameraAboveRig_m = 0.63F - 0.4F;
  Scene scene = daylight_scene();
  scene.daylight->sky_nit = 30;
  scene.materials.push_back({.albedo = Rgb{0.35F, 0.35F, 0.35F, 0}});
  Patch floor;
  floor.origin = {-20, -20, -kCameraAboveRig_m};
  floor.size_m = {40, 40};
  const Eigen::Vector3f u = 40 * floor.axis_u;
  const Eigen::Vector3f v = 40 * floor.axis_v;
  floor.corners = {floor.origin, floor.origin + u, floor.origin + u + v, floor.origin + v};
  scene.patches.push_back(floor);
  const auto rays = RayScene::create(scene).value();
  const Lighting lighting{scene, *rays};
  const Shader shader{scene, *rays, lighting};
  const CameraIntrinsics intrinsics = d435i_ir_intrinsics(kWidth, kHeight);
  const double focal_baseline = intrinsics.fx * kD435iBaseline_m;
  const InfraredView seen =
      see_infrared(*rays, shader, intrinsics, looking(0, 0, 0, kPitchRad), 0, 1);
  Bands measured = bands();
  for (std::uint64_t key = 0; key < 6; ++key) {
    const std::vector<float> depth_m = match_stereo(seen, intrinsics, {}, key);
    Disparity image;
    for (const float depth : depth_m) {
      // Millimetres, as the recording's.
      const double rounded_m = 1e-3 * std::round(1e3 * static_cast<double>(depth));
      image.push_back(rounded_m > 0 ? focal_baseline / rounded_m : 0);
    }
    add_image(image, focal_baseline, measured);
  }
  return measured;
}

TEST(FloorNoise, SimulatedDepthErrsAsThatOfARealFloor) {
  GEOFLOW_DATA_OR_SKIP(folder, "d435-floor");
  Bands real = recorded_floor(folder);
  Bands simulated = simulated_floor();
  for (std::size_t i = 0; i < real.size(); ++i) {
    ASSERT_GT(real.at(i).deviations_px.size(), 50U);
    ASSERT_GT(simulated.at(i).deviations_px.size(), 50U);
    const auto say = [](const char* name, Band& band) {
      std::cout << name << " floor at " << band.from_m << " to " << band.to_m << " m: deviation "
                << band.deviation_px() << " px, holes " << 100 * band.holes()
                << " %, correlation beside " << band.correlation_beside() << ", below "
                << band.correlation_below() << "\n";
    };
    say("real", real.at(i));
    say("simulated", simulated.at(i));
    // The real floor is not quite a plane, nor is its camera quite a pinhole: it errs a little
    // more, and what that adds is alike over many pixels.
    const double ratio = simulated.at(i).deviation_px() / real.at(i).deviation_px();
    EXPECT_GT(ratio, 0.6);
    EXPECT_LT(ratio, 1.0);
    EXPECT_NEAR(simulated.at(i).holes(), real.at(i).holes(), 0.02);
    for (const auto correlation : {&Band::correlation_beside, &Band::correlation_below}) {
      const double alike = (simulated.at(i).*correlation)() / (real.at(i).*correlation)();
      EXPECT_GT(alike, 0.4);
      EXPECT_LT(alike, 1.0);
    }
  }
}

}  // namespace
}  // namespace geoflow::simulator::tests
