#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <numbers>
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
#include "geoflow/tools/simulator/lanes.hpp"
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
constexpr int kBlock = 16;      // pixels
constexpr int kBeside_px = 11;  // where the model's correlation is a half
constexpr int kBelow_px = 7;

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

double middle(std::vector<double>& values) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, place);
  return *place;
}

/// A range of distances, and what the floor in it shows.
struct Band {
  double from_m;
  double to_m;
  // Of each block: deviation from the plane, correlation with kBeside_px and with kBelow_px away.
  std::vector<double> deviations_px{};
  std::vector<double> beside{};
  std::vector<double> below{};
  std::size_t measured = 0;
  std::size_t pixels = 0;

  [[nodiscard]] double holes() const {
    return 1 - static_cast<double>(measured) / static_cast<double>(pixels);
  }
};
using Bands = std::array<Band, 4>;

Bands bands() {
  return {{{.from_m = 0.75, .to_m = 1.25},
           {.from_m = 1.25, .to_m = 1.75},
           {.from_m = 1.75, .to_m = 2.5},
           {.from_m = 2.5, .to_m = 3.5}}};
}

/// What several images of one floor show.
struct Floor {
  Bands bands{tests::bands()};
  /// Errors of disparity of the near half, image by image [px]; 0: none.
  std::vector<Disparity> errors{};
  // Errors' products with a sine and a cosine of disparity that have a pixel's period.
  double along_sine = 0;
  double along_cosine = 0;
  std::size_t count = 0;

  /// The band of that distance, if any.
  [[nodiscard]] Band* band(double z_m) {
    for (Band& one : bands) {
      if (z_m >= one.from_m && z_m < one.to_m) {
        return &one;
      }
    }
    return nullptr;
  }
  [[nodiscard]] double ripple_px() const {
    return 2 * std::hypot(along_sine, along_cosine) / static_cast<double>(count);
  }
  /// What images at least `apart` images from one another have in common, at a pixel.
  [[nodiscard]] double common_px(std::size_t apart) const {
    double products = 0;
    std::size_t pairs = 0;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      for (std::size_t j = i + apart; j < errors.size(); ++j) {
        for (std::size_t k = 0; k < errors[i].size(); ++k) {
          products += errors[i][k] * errors[j][k];
          pairs += errors[i][k] != 0 && errors[j][k] != 0 ? 1U : 0U;
        }
      }
    }
    return std::sqrt(std::max(products, 0.0) / static_cast<double>(pairs));
  }
};

/// One block of the image, and what of it is off the plane; 0 where nothing is measured.
class Block {
 public:
  Block(const Disparity& image, const Vector3d& plane, int left, int top)
      : image_{&image}, plane_{&plane}, left_{left}, top_{top} {}

  [[nodiscard]] double error_px(int x, int y) const {
    return at(*image_, x, y) > 0 ? at(*image_, x, y) - on_plane(*plane_, x, y) : 0.0;
  }
  template <typename Visit>
  void each_pixel(const Visit& visit) const {
    for (int y = top_; y < top_ + kBlock; ++y) {
      for (int x = left_; x < left_ + kBlock; ++x) {
        visit(x, y);
      }
    }
  }
  /// Of the plane in the block's middle [px].
  [[nodiscard]] double disparity_px() const {
    return on_plane(*plane_, left_ + kBlock / 2, top_ + kBlock / 2);
  }

 private:
  const Disparity* image_;
  const Vector3d* plane_;
  int left_;
  int top_;
};

/// Adds a block that is floor: nearly nothing in it lies off the plane by a pixel, and at least two
/// fifths of it are measured. Whether it is.
bool add_block(const Block& block, Band& band) {
  std::size_t measured = 0;
  std::size_t off = 0;
  double squares = 0;
  double beside = 0;
  double below = 0;
  block.each_pixel([&](int x, int y) {
    const double error_px = block.error_px(x, y);
    measured += error_px != 0 ? 1U : 0U;
    off += std::abs(error_px) > 1 ? 1U : 0U;
    squares += error_px * error_px;
    beside += error_px * block.error_px(x + kBeside_px, y);
    below += error_px * block.error_px(x, y + kBelow_px);
  });
  constexpr std::size_t kPixels = std::size_t{kBlock} * kBlock;
  if (measured < kPixels * 2 / 5 || off > kPixels / 50) {
    return false;
  }
  band.deviations_px.push_back(std::sqrt(squares / static_cast<double>(measured)));
  band.beside.push_back(beside / squares);
  band.below.push_back(below / squares);
  band.measured += measured;
  band.pixels += kPixels;
  return true;
}

/// Takes an image in; one without a floor says nothing.
void add_image(const Disparity& image, double focal_baseline, Floor& floor) {
  constexpr int kLeft = 2 * kBlock;  // what the right camera does not see
  constexpr double kNear_m = 1.75;
  const std::optional<Vector3d> plane = find_floor(image);
  if (!plane) {
    return;
  }
  Disparity& errors = floor.errors.emplace_back(image.size());
  for (int top = 0; top + 2 * kBlock <= kHeight; top += kBlock) {
    for (int left = kLeft; left + 2 * kBlock <= kWidth; left += kBlock) {
      const Block block{image, *plane, left, top};
      const double z_m = focal_baseline / block.disparity_px();
      Band* const band = floor.band(z_m);
      if (band == nullptr || !add_block(block, *band) || z_m > kNear_m) {
        continue;
      }
      block.each_pixel([&](int x, int y) {
        const double phase = 2 * std::numbers::pi * on_plane(*plane, x, y);
        const double error_px = block.error_px(x, y);
        errors[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)] = error_px;
        floor.along_sine += error_px * std::sin(phase);
        floor.along_cosine += error_px * std::cos(phase);
      });
      floor.count += std::size_t{kBlock} * kBlock;
    }
  }
}

Floor recorded_floor(const std::filesystem::path& folder) {
  constexpr double kFocalBaseline = 383.8 * kD435iBaseline_m;
  Floor seen;
  std::vector<std::filesystem::path> files;
  for (const auto& file : std::filesystem::directory_iterator{folder / "depth"}) {
    files.push_back(file.path());
  }
  std::ranges::sort(files);
  for (std::size_t i = 0; i < files.size(); i += 3) {
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
Floor simulated_floor() {
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
  Floor measured;
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

void say(const char* name, Band& band) {
  std::cout << name << " floor at " << band.from_m << " to " << band.to_m << " m: deviation "
            << middle(band.deviations_px) << " px, holes " << 100 * band.holes()
            << " %, correlation beside " << middle(band.beside) << ", below " << middle(band.below)
            << "\n";
}

TEST(FloorNoise, SimulatedDepthErrsAsThatOfARealFloor) {
  GEOFLOW_DATA_OR_SKIP(folder, "d435-floor");
  Floor real_floor = recorded_floor(folder);
  Floor simulated_floor = tests::simulated_floor();
  for (std::size_t i = 0; i < real_floor.bands.size(); ++i) {
    Band& real = real_floor.bands.at(i);
    Band& simulated = simulated_floor.bands.at(i);
    ASSERT_GT(real.deviations_px.size(), 50U);
    ASSERT_GT(simulated.deviations_px.size(), 50U);
    say("real", real);
    say("simulated", simulated);
    // The real floor is not quite a plane: it errs a little more, alike over many pixels.
    EXPECT_NEAR(middle(simulated.deviations_px) / middle(real.deviations_px), 0.9, 0.15);
    EXPECT_NEAR(simulated.holes(), real.holes(), 0.02);
    if (real.to_m <= 2.5) {  // beyond, the real floor's own shape outweighs noise
      EXPECT_NEAR(middle(simulated.beside), middle(real.beside), 0.1);
      EXPECT_NEAR(middle(simulated.below), middle(real.below), 0.1);
    }
  }
  // Of the recording's images, ones 1.2 s apart; the robot has moved on by then.
  const double real_common_px = real_floor.common_px(4);
  const double simulated_common_px = simulated_floor.common_px(1);
  std::cout << "in common between images: real " << real_common_px << " px, simulated "
            << simulated_common_px << " px\nripple: real " << real_floor.ripple_px()
            << " px, simulated " << simulated_floor.ripple_px() << " px\n";
  EXPECT_NEAR(simulated_common_px / real_common_px, 1, 0.5);
  EXPECT_NEAR(simulated_floor.ripple_px() / real_floor.ripple_px(), 1, 0.3);
}

}  // namespace
}  // namespace geoflow::simulator::tests
