#include "replay/bag/reader.hpp"

#include <algorithm>
#include <array>
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

std::optional<StreamId> stream_of_topic(const TopicChoice& choice, std::string_view topic) {
  if (topic.empty()) {
    return std::nullopt;
  }
  const std::array<std::pair<std::string_view, StreamId>, kStreamCount> chosen = {
      {{choice.color, StreamId::kColor},
       {choice.depth, StreamId::kDepth},
       {choice.imu, StreamId::kImu},
       {choice.legs, StreamId::kLegs},
       {choice.odometry, StreamId::kBodyVelocity}}};
  const auto* const found = std::ranges::find(chosen, topic, &decltype(chosen)::value_type::first);
  return found == chosen.end() ? std::nullopt : std::optional{found->second};
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
                               .stream = stream_of_topic(choice_, topic.name)});
    }
    bag_->select([this](std::string_view topic) {
      return !topic.empty() &&
             (topic == choice_.color || topic == choice_.depth || topic == choice_.imu ||
              topic == choice_.legs || topic == choice_.odometry);
    });
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
    if (!*message) {
      return std::nullopt;
    }
    auto event = to_event(**message);
    if (!event) {
      return tl::unexpected{std::move(event).error().in((*message)->origin)};
    }
    return std::optional{std::move(*event)};
  }

 private:
  [[nodiscard]] Result<Event> to_event(const BagMessage& message) const {
    if (message.topic == choice_.color) {
      return image_event(message, ImageStream::kColor);
    }
    if (message.topic == choice_.depth) {
      return image_event(message, ImageStream::kDepth);
    }
    if (message.topic == choice_.imu) {
      return sample_event<ros::Imu, ImuClock, ImuSample>(message);
    }
    if (message.topic == choice_.legs) {
      return sample_event<ros::JointState, LegClock, LegSample>(message);
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
