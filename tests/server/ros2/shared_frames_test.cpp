#include "server/ros2/shared_frames.h"

#include <gtest/gtest.h>

#include <array>

namespace cairn::server {
namespace {

ros2::Transform Link(const std::string& parent, const std::string& child, double x) {
  ros2::Transform transform;
  transform.header.frame = parent;
  transform.child_frame = child;
  transform.T_frame_child.translation.x() = x;
  return transform;
}

std::optional<Pose2> Find(const ros2::FrameTree& tree, const std::string& to, const std::string& from) {
  const auto motion = ros2::FindMotion(std::array<const ros2::FrameTree*, 1>{&tree}, to, from, {});
  return motion ? std::optional(ros2::PlanarPart(*motion)) : std::nullopt;
}

ros2::Transforms Message(const ros2::Transform& transform) {
  ros2::Transforms message;
  message.transforms.push_back(transform);
  return message;
}

constexpr ros2::WriterId kFirst{1}, kSecond{2};

// Two robots with the same names of frames on the shared topic: each would be mounted like the other.
TEST(SharedFrames, AFrameOfTwoPublishersIsNobodys) {
  SharedFrames frames;
  EXPECT_EQ(frames.Take(Message(Link("base_link", "laser", 1.0)), kFirst, true).transforms.size(), 1U);
  EXPECT_EQ(frames.Take(Message(Link("base_link", "laser", 2.0)), kSecond, true).transforms.size(), 0U);
  EXPECT_FALSE(Find(frames.tree(), "base_link", "laser"));
  EXPECT_EQ(frames.contended(), std::vector<std::string>{"laser"});
  // The first one leaves: what the second has said counts from now on.
  frames.SetWriters({kSecond});
  EXPECT_TRUE(frames.contended().empty());
  EXPECT_NEAR(Find(frames.tree(), "base_link", "laser")->x, 2.0, 1e-12);
}

TEST(SharedFrames, TwoPublishersMaySayTheSameStaticTransform) {
  SharedFrames frames;
  static_cast<void>(frames.Take(Message(Link("base_link", "laser", 1.0)), kFirst, true));
  EXPECT_EQ(frames.Take(Message(Link("base_link", "laser", 1.0)), kSecond, true).transforms.size(), 1U);
  EXPECT_TRUE(frames.contended().empty());
  // But not the same moving one: then two robots drive.
  static_cast<void>(frames.Take(Message(Link("odom", "base_link", 1.0)), kFirst, false));
  EXPECT_TRUE(frames.Take(Message(Link("odom", "base_link", 1.0)), kSecond, false).transforms.empty());
}

TEST(SharedFrames, APublisherThatWasStartedAgainOwnsItsFrames) {
  SharedFrames frames;
  static_cast<void>(frames.Take(Message(Link("base_link", "laser", 1.0)), kFirst, true));
  frames.SetWriters({kSecond});
  EXPECT_TRUE(Find(frames.tree(), "base_link", "laser")) << "meanwhile it is mounted as before";
  EXPECT_EQ(frames.Take(Message(Link("base_link", "laser", 3.0)), kSecond, true).transforms.size(), 1U);
  EXPECT_NEAR(Find(frames.tree(), "base_link", "laser")->x, 3.0, 1e-12);
}

// Those of robots that were gone kept every later robot from being mounted.
TEST(SharedFrames, WhereThereAreTooManyThoseOfPublishersThatAreGoneGiveWay) {
  SharedFrames frames;
  const auto take = [&frames](const ros2::WriterId& writer, const std::string& child) {
    return frames.Take(Message(Link("base_link", child, 1.0)), writer, true).transforms.size();
  };
  const auto name = [](std::size_t i) { return "frame" + std::to_string(i); };
  for (std::size_t i = 0; i < ros2::FrameTree::kMaxFrames; ++i) EXPECT_EQ(take(i < 2 ? kFirst : kSecond, name(i)), 1U);
  EXPECT_FALSE(frames.full());
  EXPECT_EQ(take(kSecond, "one more"), 0U);
  EXPECT_TRUE(frames.full());

  frames.SetWriters({kSecond});  // The frame that was left out is not said again.
  EXPECT_FALSE(frames.full());
  EXPECT_TRUE(Find(frames.tree(), "base_link", "one more"));
  EXPECT_FALSE(Find(frames.tree(), "base_link", name(0)));
  EXPECT_EQ(take(kSecond, name(1)), 1U) << "its publisher was started again: it stays";
  EXPECT_EQ(take(kSecond, "and another"), 0U);
  EXPECT_TRUE(Find(frames.tree(), "base_link", name(1)));
  EXPECT_TRUE(frames.full());
}

}  // namespace
}  // namespace cairn::server
