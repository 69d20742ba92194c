#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "geoflow/drivers/recording.hpp"
#include "geoflow/hal/result.hpp"

#include "replay/bag/bag.hpp"

namespace geoflow::drivers::bag {

/// The topics of one bag by what they carry; an empty name: the bag has none.
struct TopicChoice {
  std::string color;  ///< sensor_msgs Image or CompressedImage
  std::string depth;  ///< sensor_msgs Image or CompressedImage
  std::string camera_info;
  std::string imu;
  std::string legs;
  std::string odometry;
};

/// Finds the topics that `names` asks for, in this order: the very name; the name with
/// image_transport's `/compressed` or `/compressedDepth` behind it; the only topic of a fitting
/// type that ends with the name (realsense-ros puts a namespace before it), for images also without
/// the name's first part (another camera name). camera_info is looked for beside the colour topic
/// first. A name that exists with another type, a name that fits several topics, and a bag with one
/// of colour and depth alone, or with none of all, are errors that list what the bag has.
[[nodiscard]] Result<TopicChoice> choose_topics(const std::vector<BagTopic>& topics,
                                                const TopicNames& names);

/// `/tf (tf2_msgs/msg/TFMessage, 517 messages), …`
[[nodiscard]] std::string describe_topics(const std::vector<BagTopic>& topics);

}  // namespace geoflow::drivers::bag
