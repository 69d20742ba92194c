#include "geoflow/tools/simulator/tum_writer.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>

#include <fmt/core.h>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

#include "geoflow/drivers/calibration_file.hpp"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/geometry.hpp"
#include "geoflow/hal/image.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

namespace geoflow::simulator {
namespace {

std::string seconds(Duration stamp) {
  constexpr std::int64_t kNanoseconds = 1'000'000'000;
  return fmt::format("{}.{:09}", stamp.count() / kNanoseconds, stamp.count() % kNanoseconds);
}

int mat_type(PixelFormat format) {
  switch (format) {
    case PixelFormat::kDepth16:
      return CV_16UC1;
    case PixelFormat::kGray8:
      return CV_8UC1;
    default:
      return CV_8UC3;
  }
}

bool write_png(const std::filesystem::path& file, const FrameRef& image) {
  const ImageShape& shape = image.shape();
  // OpenCV takes its input as a non-const Mat, but does not write to it.
  const cv::Mat pixels{shape.height, shape.width, mat_type(shape.format),
                       const_cast<std::byte*>(
                           image.bytes().data())};  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  try {
    return cv::imwrite(file.string(), pixels, {cv::IMWRITE_PNG_COMPRESSION, 1});
  } catch (const cv::Exception&) {
    return false;
  }
}

}  // namespace

TumWriter::TumWriter(std::filesystem::path directory) : directory_{std::move(directory)} {}

Result<void> TumWriter::open(const Calibration& calibration) {
  std::error_code error;
  for (const char* const folder : {"rgb", "depth"}) {
    std::filesystem::create_directories(directory_ / folder, error);
    if (error) {
      return fail(ErrorCode::kSystem, "{}: {}", (directory_ / folder).string(), error.message());
    }
  }
  color_.open(directory_ / "rgb.txt");
  depth_.open(directory_ / "depth.txt");
  imu_.open(directory_ / "imu.csv");
  color_ << "# timestamp [s] filename\n";
  depth_ << "# timestamp [s] filename\n";
  imu_ << "#timestamp [ns],w_x [rad/s],w_y,w_z,a_x [m/s^2],a_y,a_z\n";
  return drivers::save_calibration(calibration, directory_);
}

void TumWriter::write(const std::string& folder, std::ofstream& list, Duration stamp,
                      const FrameRef& image) {
  const std::string name = fmt::format("{}/{}.png", folder, seconds(stamp));
  if (status_ && !write_png(directory_ / name, image)) {
    status_ = fail(ErrorCode::kSystem, "{}: cannot be written", (directory_ / name).string());
  }
  list << seconds(stamp) << " " << name << "\n";
}

void TumWriter::on_color(const Arrival<CameraClock, ColorFrame>& frame) {
  write("rgb", color_, frame.t_device.time_since_epoch(), frame.sample.image);
}

void TumWriter::on_depth(const Arrival<CameraClock, DepthFrame>& frame) {
  write("depth", depth_, frame.t_device.time_since_epoch(), frame.sample.image);
}

void TumWriter::on_imu(const Arrival<ImuClock, ImuSample>& sample) {
  const Vector3d& w = sample.sample.gyro_radps;
  const Vector3d& a = sample.sample.accel_mps2;
  imu_ << fmt::format("{},{},{},{},{},{},{}\n", sample.t_device.time_since_epoch().count(), w.x(),
                      w.y(), w.z(), a.x(), a.y(), a.z());
}

Result<void> TumWriter::close() {
  for (std::ofstream* file : {&color_, &depth_, &imu_}) {
    file->close();
    if (status_ && !*file) {
      status_ = fail(ErrorCode::kSystem, "{}: a list cannot be written", directory_.string());
    }
  }
  return status_;
}

}  // namespace geoflow::simulator
