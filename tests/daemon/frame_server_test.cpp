#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "geoflow/daemon/geoflow_protocol.h"
#include "geoflow/hal/calibration.hpp"
#include "geoflow/hal/image.hpp"

#include "geoflow_client.h"
#include "server_fixture.hpp"
#include "stream/frame_streams.hpp"

namespace geoflow::daemon {
namespace {

using testing::HasSubstr;

constexpr int kPatienceMs = 5000;
constexpr int kWidth = 32;
constexpr int kHeight = 24;

/// Images through the server to clients in C.
class FrameServer : public ServerTest {
 protected:
  /// A client, closed at the end of scope.
  struct Client : geoflow_client {
    Client(const std::string& path, std::uint32_t want, double max_rate_hz = 0) : geoflow_client{} {
      const geoflow_options options{
          .socket = path.c_str(), .name = "test", .want = want, .max_rate_hz = max_rate_hz};
      EXPECT_EQ(geoflow_connect(this, &options), 0) << &error[0];
    }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;
    ~Client() { geoflow_close(this); }
  };

  /// Publishes the images of a frame, whose pixels all have its number.
  void publish_images(std::uint64_t frame) {
    on_loop([&] {
      Images images{.t_capture_ns = 1, .frame = frame};
      images.color =
          pool_.acquire({.width = kWidth, .height = kHeight, .format = PixelFormat::kGray8});
      images.depth =
          pool_.acquire({.width = kWidth, .height = kHeight, .format = PixelFormat::kDepth16});
      for (std::byte& byte : images.color.writable_bytes()) {
        byte = static_cast<std::byte>(frame);
      }
      for (std::byte& byte : images.depth.writable_bytes()) {
        byte = static_cast<std::byte>(frame);
      }
      for (const StreamedFrame& streamed :
           streams_.publish(images, Calibration{}, poses_->wanted_frames())) {
        poses_->publish(streamed);
      }
    });
  }
  static geoflow_event next(Client& client) {
    geoflow_event event{};
    EXPECT_EQ(geoflow_next(&client, &event, kPatienceMs), GEOFLOW_RECEIVED) << &client.error[0];
    return event;
  }
  static bool is_silent(Client& client) {
    geoflow_event event{};
    return geoflow_next(&client, &event, 20) == GEOFLOW_TIMED_OUT;
  }

  FramePool pool_{8};
  FrameStreams streams_;
};

TEST_F(FrameServer, AClientGetsTheImagesThatItAskedForAndNoOther) {
  Client depth{config_.pose.string(), GEOFLOW_WANT_DEPTH};
  Client poses{config_.pose.string(), GEOFLOW_WANT_POSE};
  for (std::uint64_t frame = 1; frame < 20; ++frame) {
    publish_images(frame);
    const geoflow_event event = next(depth);
    ASSERT_EQ(event.type, GEOFLOW_FRAME);
    EXPECT_EQ(event.frame.stream, GEOFLOW_DEPTH + 0U);
    EXPECT_EQ(event.frame.frame, frame);
    EXPECT_EQ(event.frame.width, kWidth + 0U);
    ASSERT_EQ(event.frame.bytes, std::size_t{2} * kWidth * kHeight);
    std::vector<unsigned char> pixels(event.frame.bytes);
    ASSERT_EQ(geoflow_copy_frame(&depth, &event.frame, pixels.data()), 0) << &depth.error[0];
    EXPECT_THAT(pixels, testing::Each(frame));
    EXPECT_EQ(depth.dropped, 0U);
  }
  EXPECT_TRUE(is_silent(depth));
  EXPECT_TRUE(is_silent(poses));
}

TEST_F(FrameServer, PosesAndImagesComeOnOneConnection) {
  Client client{config_.pose.string(), GEOFLOW_WANT_POSE | GEOFLOW_WANT_COLOR | GEOFLOW_WANT_DEPTH};
  publish(7);
  publish_images(7);
  EXPECT_EQ(next(client).type, GEOFLOW_POSE);
  EXPECT_EQ(next(client).frame.stream, GEOFLOW_COLOR + 0U);
  EXPECT_EQ(next(client).frame.stream, GEOFLOW_DEPTH + 0U);
}

TEST_F(FrameServer, AFrameThatWasOverwrittenIsNotTakenForAnother) {
  Client client{config_.pose.string(), GEOFLOW_WANT_COLOR};
  publish_images(1);
  const geoflow_event early = next(client);
  for (std::uint64_t frame = 2; frame < 10; ++frame) {  // as many as the ring has slots
    publish_images(frame);
  }
  std::vector<unsigned char> pixels(early.frame.bytes);
  EXPECT_EQ(geoflow_copy_frame(&client, &early.frame, pixels.data()), -1);
  EXPECT_THAT(&client.error[0], HasSubstr("no longer there"));
}

TEST_F(FrameServer, ASlowClientLosesImagesWhichAreCountedAndGoesOnWithNewOnes) {
  Client client{config_.pose.string(), GEOFLOW_WANT_COLOR};
  constexpr std::uint64_t kPublished = 100;
  for (std::uint64_t frame = 1; frame <= kPublished; ++frame) {
    publish_images(frame);
  }
  std::uint64_t received = 0;
  while (!is_silent(client)) {
    ++received;
  }
  EXPECT_GT(received, 0U);
  EXPECT_LT(received, kPublished / 2);
  publish_images(kPublished + 1);
  EXPECT_EQ(next(client).frame.frame, kPublished + 1);
  EXPECT_EQ(client.dropped, kPublished - received);
}

TEST_F(FrameServer, AClientThatReadsNothingIsCutOff) {
  const Client client{config_.pose.string(), GEOFLOW_WANT_COLOR};
  std::uint64_t frame = 0;
  EXPECT_TRUE(eventually([&] {
    publish_images(++frame);
    return clients() == 0;
  }));
}

TEST_F(FrameServer, ImagesComeAsOftenAsWasAskedFor) {
  Client client{config_.pose.string(), GEOFLOW_WANT_COLOR, 1.0 / 3600};
  publish_images(1);
  publish_images(2);
  EXPECT_EQ(next(client).frame.frame, 1U);
  EXPECT_TRUE(is_silent(client));
}

TEST_F(FrameServer, NothingIsWantedOnceTheLastClientHasGone) {
  {
    const Client client{config_.pose.string(), GEOFLOW_WANT_COLOR};
    on_loop([&] { EXPECT_EQ(poses_->wanted_frames(), GEOFLOW_WANT_COLOR + 0U); });
  }
  EXPECT_TRUE(eventually([&] { return clients() == 0; }));
  on_loop([&] { EXPECT_EQ(poses_->wanted_frames(), 0U); });
}

}  // namespace
}  // namespace geoflow::daemon
