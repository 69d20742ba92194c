#include "replay/bag/topic_choice.hpp"

#include <algorithm>
#include <initializer_list>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <fmt/format.h>
#include <tl/expected.hpp>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/bag/bag.hpp"
#include "replay/cdr/messages.hpp"

namespace geoflow::drivers::bag {
namespace {

using Types = std::vector<std::string_view>;

/// What is looked for.
struct Wanted {
  const char* what;  ///< for people
  Types types;
  std::vector<std::string> names;     ///< in order of preference
  std::vector<std::string> suffixes;  ///< of one topic only, in order of preference
};

const BagTopic* find(const std::vector<BagTopic>& topics, std::string_view name) {
  const auto found = std::ranges::find(topics, name, &BagTopic::name);
  return found == topics.end() ? nullptr : &*found;
}

bool fits(const BagTopic& topic, const Types& types) {
  return std::ranges::find(types, topic.type) != types.end();
}

Result<std::string> by_suffix(const std::vector<BagTopic>& topics, const Wanted& wanted) {
  for (const std::string& suffix : wanted.suffixes) {
    std::vector<BagTopic> found;
    std::ranges::copy_if(topics, std::back_inserter(found), [&](const BagTopic& topic) {
      return topic.name.ends_with(suffix) && fits(topic, wanted.types);
    });
    if (found.size() > 1) {
      return fail(ErrorCode::kInvalidArgument,
                  "several topics could be the {}, name one of them: {}", wanted.what,
                  describe_topics(found));
    }
    if (!found.empty()) {
      return found.front().name;
    }
  }
  return std::string{};
}

Result<std::string> choose(const std::vector<BagTopic>& topics, const Wanted& wanted) {
  for (const std::string& name : wanted.names) {
    if (const BagTopic* topic = find(topics, name)) {
      if (fits(*topic, wanted.types)) {
        return name;
      }
      return fail(ErrorCode::kInvalidArgument, "topic {} is of type {}, but the {} must be {}",
                  name, topic->type, wanted.what, fmt::join(wanted.types, " or "));
    }
  }
  return by_suffix(topics, wanted);
}

/// The name without its first part: `/color/image_raw` of `/camera/color/image_raw`; empty where
/// nothing is left that says what the topic is.
std::string without_first_part(const std::string& name) {
  const auto second = name.find('/', 1);
  const bool tells = second != std::string::npos && name.find('/', second + 1) != std::string::npos;
  return tells ? name.substr(second) : std::string{};
}

/// Everything that `name` can mean, the best first.
std::vector<std::string> with_transports(const std::string& name,
                                         std::initializer_list<const char*> transports) {
  std::vector<std::string> names;
  if (!name.empty()) {
    names.push_back(name);
    for (const char* transport : transports) {
      names.push_back(name + transport);
    }
  }
  return names;
}

Wanted image(const char* what, const std::string& name,
             std::initializer_list<const char*> transports) {
  Wanted wanted{.what = what,
                .types = {ros::Image::kType, ros::CompressedImage::kType},
                .names = with_transports(name, transports),
                .suffixes = with_transports(name, transports)};
  std::ranges::copy(with_transports(without_first_part(name), transports),
                    std::back_inserter(wanted.suffixes));
  return wanted;
}

Wanted simple(const char* what, std::string_view type, const std::string& name) {
  return {.what = what,
          .types = {type},
          .names = with_transports(name, {}),
          .suffixes = with_transports(name, {})};
}

std::string beside(const std::string& image_topic) {
  std::string name = image_topic;
  for (const char* transport : {"/compressed", "/compressedDepth"}) {
    if (name.ends_with(transport)) {
      name.resize(name.size() - std::string_view{transport}.size());
      break;
    }
  }
  return name.substr(0, name.rfind('/')) + "/camera_info";
}

bool has_other_samples(const TopicChoice& choice) {
  return !choice.imu.empty() || !choice.legs.empty() || !choice.odometry.empty();
}

}  // namespace

std::string describe_topics(const std::vector<BagTopic>& topics) {
  std::string text;
  for (const BagTopic& topic : topics) {
    text += fmt::format("{}{} ({}, {} messages)", text.empty() ? "" : ", ", topic.name, topic.type,
                        topic.count);
  }
  return text.empty() ? "none" : text;
}

Result<TopicChoice> choose_topics(const std::vector<BagTopic>& topics, const TopicNames& names) {
  TopicChoice choice;
  const auto take = [&topics](std::string& target, const Wanted& wanted) -> Result<void> {
    return choose(topics, wanted).map([&target](std::string name) { target = std::move(name); });
  };
  auto done =
      take(choice.color, image("colour image", names.color, {"/compressed"}))
          .and_then([&] {
            return take(choice.depth,
                        image("depth image", names.depth, {"/compressedDepth", "/compressed"}));
          })
          .and_then(
              [&] { return take(choice.imu, simple("camera's IMU", ros::Imu::kType, names.imu)); })
          .and_then([&] {
            return take(choice.legs, simple("leg encoders", ros::JointState::kType, names.legs));
          })
          .and_then([&] {
            return take(choice.odometry, simple("odometry", ros::Odometry::kType, names.odometry));
          });
  if (!done) {
    return tl::unexpected{std::move(done).error()};
  }
  if (choice.color.empty() && choice.depth.empty() && has_other_samples(choice)) {
    return choice;
  }
  if (choice.color.empty() || choice.depth.empty()) {
    const char* missing = !choice.color.empty()   ? "depth topic"
                          : !choice.depth.empty() ? "colour topic"
                                                  : "camera topics";
    return fail(ErrorCode::kNotFound, "no {}: looked for {} and {}; the bag has: {}", missing,
                names.color, names.depth, describe_topics(topics));
  }
  Wanted info = simple("camera_info", ros::CameraInfo::kType, names.camera_info);
  info.names.insert(info.names.begin(), beside(choice.color));
  if (auto taken = take(choice.camera_info, info); !taken) {
    return tl::unexpected{std::move(taken).error()};
  }
  return choice;
}

}  // namespace geoflow::drivers::bag
