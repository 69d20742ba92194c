#include "replay/bag/reader.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <tl/expected.hpp>

#include "geoflow/drivers/faults.hpp"
#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/samples.hpp"
#include "geoflow/hal/time.hpp"

#include "replay/bag/bag.hpp"
#include "replay/bag/bag_calibration.hpp"
#include "replay/bag/extras.hpp"
#include "replay/bag/samples.hpp"
#include "replay/bag/topic_choice.hpp"
#include "replay/cdr/codec.hpp"
#include "replay/cdr/messages.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::bag {
namespace {

HostTime at(std::int64_t ns) {
  return HostTime{Duration{ns}};
}

/// The sample with its stamps. A stamp of zero is ROS's way to say that there is none: the time of
/// recording stands in.
template <typename Clock, typename Sample>
Result<Event> stamped(const BagMessage& message, const ros::Header& header, Result<Sample> sample) {
  const auto stamp = to_duration(header.stamp);
  if (!stamp || !sample) {
    return tl::unexpected{stamp ? std::move(sample).error() : stamp.error()};
  }
  const HostTime arrival = at(message.timestamp_ns);
  const Duration since_epoch = *stamp == Duration{} ? arrival.time_since_epoch() : *stamp;
  return Event{Arrival<Clock, Sample>{DeviceTime<Clock>{since_epoch}, arrival, std::move(*sample)}};
}

template <typename Message>
Result<Event> image_event(const BagMessage& message, ImageStream stream) {
  return cdr::decode<Message>(message.data).and_then([&](const Message& image) {
    return to_image(image, stream).and_then([&](EncodedImage encoded) {
      encoded.origin = message.origin;
      return stamped<CameraClock, EncodedImage>(message, image.header, std::move(encoded));
    });
  });
}

Result<Event> image_event(const BagMessage& message, ImageStream stream) {
  return message.type == ros::Image::kType ? image_event<ros::Image>(message, stream)
                                           : image_event<ros::CompressedImage>(message, stream);
}

/// A sample of a message type that is not an image.
template <typename Message, typename Clock, typename Sample>
Result<Event> sample_event(const BagMessage& message) {
  return cdr::decode<Message>(message.data).and_then([&](const Message& decoded) {
    return stamped<Clock, Sample>(message, decoded.header, Result<Sample>{to_sample(decoded)});
  });
}

class BagReader final : public RecordingReader {
 public:
  BagReader(std::unique_ptr<Bag> bag, TopicChoice choice)
      : bag_{std::move(bag)}, choice_{std::move(choice)} {}

  void prepare(const TopicNames& names) {
    const Extras extras = parse_extras(bag_->custom_data());
    stamps_ = extras.stamps;
    calibration_ = find_bag_calibration(*bag_, choice_, names, extras);
    info_ = {.format = "rosbag2",
             .start = at(bag_->start_ns()),
             .end = at(bag_->end_ns()),
             .streams = {}};
    for (const BagTopic& topic : bag_->topics()) {
      info_.streams.push_back({.name = topic.name,
                               .type = topic.type,
                               .count = topic.count,
                               .stream = stream_of(topic.name)});
    }
    bag_->select([this](std::string_view topic) { return stream_of(topic).has_value(); });
  }

  [[nodiscard]] const RecordingInfo& info() const override { return info_; }
  [[nodiscard]] FoundCalibration calibration() const override { return calibration_; }
  [[nodiscard]] RecordingStamps stamps() const override { return stamps_; }
  [[nodiscard]] bool complete() const override { return bag_->complete(); }

  [[nodiscard]] Result<std::optional<Event>> next() override {
    const auto message = bag_->next();
    if (!message) {
      return tl::unexpected{message.error()};
    }
    const std::optional<BagMessage>& found = *message;
    if (!found) {
      return std::nullopt;
    }
    auto event = to_event(*found);
    if (!event) {
      return tl::unexpected{std::move(event).error().in(found->origin)};
    }
    return std::optional{std::move(*event)};
  }

 private:
  [[nodiscard]] std::optional<StreamId> stream_of(std::string_view topic) const {
    const std::array<std::pair<std::string_view, StreamId>, kStreamCount> streams{{
        {choice_.color, StreamId::kColor},
        {choice_.depth, StreamId::kDepth},
        {choice_.imu, StreamId::kImu},
        {choice_.legs, StreamId::kLegs},
        {choice_.odometry, StreamId::kBodyVelocity},
    }};
    const auto* const found = std::ranges::find_if(
        streams, [topic](const auto& stream) { return !topic.empty() && stream.first == topic; });
    return found == streams.end() ? std::nullopt : std::optional{found->second};
  }
  [[nodiscard]] Result<Event> to_event(const BagMessage& message) const {
    switch (stream_of(message.topic).value_or(StreamId::kBodyVelocity)) {
      case StreamId::kColor:
        return image_event(message, ImageStream::kColor);
      case StreamId::kDepth:
        return image_event(message, ImageStream::kDepth);
      case StreamId::kImu:
        return sample_event<ros::Imu, ImuClock, ImuSample>(message);
      case StreamId::kLegs:
        return sample_event<ros::JointState, LegClock, LegSample>(message);
      case StreamId::kBodyVelocity:
        break;
    }
    return sample_event<ros::Odometry, LegClock, BodyVelocitySample>(message);
  }

  std::unique_ptr<Bag> bag_;
  TopicChoice choice_;
  RecordingInfo info_;
  FoundCalibration calibration_;
  RecordingStamps stamps_;
};

}  // namespace

bool looks_like(const std::filesystem::path& path) {
  return Bag::looks_like_one(path);
}

Result<std::unique_ptr<RecordingReader>> open(const std::filesystem::path& path,
                                              const TopicNames& names) {
  auto bag = Bag::open(path);
  if (!bag) {
    return tl::unexpected{std::move(bag).error()};
  }
  auto choice = choose_topics((*bag)->topics(), names);
  if (!choice) {
    return tl::unexpected{std::move(choice).error().in(path.native())};
  }
  auto reader = std::make_unique<BagReader>(std::move(*bag), std::move(*choice));
  reader->prepare(names);
  return reader;
}

}  // namespace geoflow::drivers::bag
