#pragma once

#include "geoflow/drivers/recording.hpp"

#include "replay/bag/bag.hpp"
#include "replay/bag/extras.hpp"
#include "replay/bag/topic_choice.hpp"
#include "replay/reader.hpp"

namespace geoflow::drivers::bag {

/// What a bag says of its sensors: intrinsics from the first usable camera_info, T_base_cam and
/// T_cam_imu from /tf_static by the frames that the camera_info and the first IMU message name
/// (else the ones of realsense-ros), depth unit, IMU noise and time shift from custom_data (a depth
/// unit of 1 mm where it says none: REP-118). The base frame is `names.base_frame`, else `base`.
/// What is not there or not usable stays empty, with a line in the log. Moves the bag's reading
/// position.
[[nodiscard]] FoundCalibration find_bag_calibration(Bag& bag, const TopicChoice& choice,
                                                    const TopicNames& names, const Extras& extras);

}  // namespace geoflow::drivers::bag
