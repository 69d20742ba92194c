#include "geoflow/hal/image.hpp"

#include <cstddef>
#include <optional>

#include <gtest/gtest.h>

namespace geoflow {
namespace {

constexpr ImageShape kSmall{.width = 4, .height = 2, .format = PixelFormat::kDepth16};

TEST(FramePool, HandsOutEachBufferOnceAndTakesItBack) {
  FramePool pool{2};
  std::optional<FrameRef> first = pool.acquire(kSmall);
  const FrameRef second = pool.acquire(kSmall);
  ASSERT_TRUE(*first);
  ASSERT_TRUE(second);
  EXPECT_NE(first->bytes().data(), second.bytes().data());
  EXPECT_FALSE(pool.acquire(kSmall));

  FrameRef copy = *first;
  first.reset();
  EXPECT_FALSE(pool.acquire(kSmall)) << "a copy still holds the buffer";
  copy = FrameRef{};
  EXPECT_TRUE(pool.acquire(kSmall));
}

TEST(FramePool, FrameOutlivesItsPool) {
  FrameRef frame;
  {
    FramePool pool{1};
    frame = pool.acquire(kSmall);
  }
  frame.writable_bytes()[kSmall.size_bytes() - 1] = std::byte{7};
  EXPECT_EQ(frame.bytes().back(), std::byte{7});
  EXPECT_EQ(frame.bytes().size(), 16U);
}

}  // namespace
}  // namespace geoflow
