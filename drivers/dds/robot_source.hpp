#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <thread>

#include "geoflow/drivers/dds_robot.hpp"
#include "geoflow/hal/ports.hpp"
#include "geoflow/hal/result.hpp"
#include "geoflow/hal/time.hpp"

#include "dds/channel.hpp"
#include "dds/message_filter.hpp"
#include "port.hpp"

namespace geoflow::drivers::dds {

/// Legs and body IMU of one stream of LowState, read by a thread of its own from the beginning.
/// What goes wrong is in both ports' health; what cannot be opened is tried again, with growing
/// pauses.
class RobotSource final : public DdsRobot, private MessageSink {
 public:
  /// `where` names topic, domain and interface in sentences.
  RobotSource(std::unique_ptr<Channel> channel, std::string where);
  ~RobotSource() override;
  RobotSource(const RobotSource&) = delete;
  RobotSource& operator=(const RobotSource&) = delete;

  [[nodiscard]] Legs& legs() override { return legs_; }
  [[nodiscard]] Imu& body_imu() override { return imu_; }

 private:
  void on_message(std::span<const std::byte> cdr, HostTime t_arrival) override;
  void run(const std::stop_token& stop);
  [[nodiscard]] bool open(Duration& pause);
  void report(HostTime now);

  std::unique_ptr<Channel> channel_;
  MessageFilter filter_;
  Port<LegSink> legs_;
  Port<ImuSink> imu_;
  bool open_ = false;
  std::string logged_;  // the trouble that was logged last
  std::jthread thread_;
};

}  // namespace geoflow::drivers::dds
