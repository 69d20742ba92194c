#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "replay/bag/samples.hpp"
#include "replay/cdr/codec.hpp"
#include "replay/cdr/messages.hpp"
#include "replay/reader.hpp"

// Any bytes as a message of every type: read or refused, and what was read can be written, read
// again and made a sample of.

namespace {

using namespace geoflow::drivers;  // NOLINT(google-build-using-namespace): a program of its own

template <typename Message, typename Use>
void check(std::span<const std::byte> bytes, Use use) {
  const auto message = cdr::decode<Message>(bytes);
  if (!message) {
    return;
  }
  const auto written = cdr::encode(*message);
  const auto again = cdr::decode<Message>(written);
  if (!again || cdr::encode(*again) != written) {
    std::abort();
  }
  use(*message);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span{data, size});
  check<ros::Header>(bytes,
                     [](const ros::Header& header) { (void)bag::to_duration(header.stamp); });
  check<ros::Image>(bytes, [](const ros::Image& image) {
    (void)bag::to_image(image, ImageStream::kColor);
    (void)bag::to_image(image, ImageStream::kDepth);
  });
  check<ros::CompressedImage>(bytes, [](const ros::CompressedImage& image) {
    (void)bag::to_image(image, ImageStream::kDepth);
  });
  check<ros::CameraInfo>(bytes,
                         [](const ros::CameraInfo& info) { (void)bag::to_intrinsics(info); });
  check<ros::Imu>(bytes, [](const ros::Imu& imu) { (void)bag::to_sample(imu); });
  check<ros::JointState>(bytes,
                         [](const ros::JointState& joints) { (void)bag::to_sample(joints); });
  check<ros::Odometry>(bytes,
                       [](const ros::Odometry& odometry) { (void)bag::to_sample(odometry); });
  check<ros::TfMessage>(bytes, [](const ros::TfMessage& tf) {
    for (const auto& transform : tf.transforms) {
      (void)bag::to_se3(transform.transform);
    }
  });
  return 0;
}
