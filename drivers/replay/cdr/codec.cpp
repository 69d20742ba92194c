#include "replay/cdr/codec.hpp"

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "geoflow/hal/result.hpp"

#include "replay/cdr/cursor.hpp"
#include "replay/cdr/messages.hpp"  // IWYU pragma: keep (used by the instantiations)

namespace geoflow::drivers::cdr {

template <typename Message>
Result<Message> decode(std::span<const std::byte> bytes) {
  // Transports pad a message to a multiple of 4, some serialisers to their largest alignment, 8.
  constexpr std::size_t kMaxPaddingBytes = 7;
  Reader reader{bytes};
  Message message;
  reader.read(message);
  if (const auto& error = reader.error()) {
    return fail(ErrorCode::kInvalidData, "{}: {}", Message::kType, *error);
  }
  if (reader.remaining() > kMaxPaddingBytes) {
    return fail(ErrorCode::kInvalidData, "{}: {} bytes are left over at byte {}", Message::kType,
                reader.remaining(), bytes.size() - reader.remaining());
  }
  return message;
}

template <typename Message>
std::vector<std::byte> encode(const Message& message) {
  Writer writer;
  writer.write(message);
  return std::move(writer).take();
}

// NOLINTBEGIN(bugprone-macro-parentheses): the argument is a type
#define GEOFLOW_INSTANTIATE_CODEC(Message)                              \
  template Result<Message> decode<Message>(std::span<const std::byte>); \
  template std::vector<std::byte> encode<Message>(const Message&);
GEOFLOW_INSTANTIATE_CODEC(ros::Header)
GEOFLOW_INSTANTIATE_CODEC(ros::Image)
GEOFLOW_INSTANTIATE_CODEC(ros::CompressedImage)
GEOFLOW_INSTANTIATE_CODEC(ros::CameraInfo)
GEOFLOW_INSTANTIATE_CODEC(ros::Imu)
GEOFLOW_INSTANTIATE_CODEC(ros::JointState)
GEOFLOW_INSTANTIATE_CODEC(ros::Odometry)
GEOFLOW_INSTANTIATE_CODEC(ros::TfMessage)
#undef GEOFLOW_INSTANTIATE_CODEC
// NOLINTEND(bugprone-macro-parentheses)

}  // namespace geoflow::drivers::cdr
