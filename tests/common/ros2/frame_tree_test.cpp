#include "common/ros2/frame_tree.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

namespace cairn::ros2 {
namespace {

Transform Link(const std::string& parent, const std::string& child, double x, double yaw = 0.0) {
  Transform transform;
  transform.header.frame = parent;
  transform.child_frame = child;
  transform.T_frame_child = {{x, 0.0, 0.1}, Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()))};
  return transform;
}

std::optional<Pose2> Find(const FrameTree& tree, const std::string& to, const std::string& from,
                          const FrameTree& other = {}) {
  const auto motion =
      FindMotion(std::array<const FrameTree*, 2>{&tree, &other}, to, from, std::array{std::string("odom")});
  return motion ? std::optional(PlanarPart(*motion)) : std::nullopt;
}

TEST(FrameTree, FollowsLinksUpAndDown) {
  FrameTree tree;
  ASSERT_TRUE(tree.Set(Link("base_footprint", "base_link", 0.0)));
  ASSERT_TRUE(tree.Set(Link("base_link", "mast", 1.0, kPi / 2)));
  ASSERT_TRUE(tree.Set(Link("mast", "laser", 2.0)));
  const auto up = Find(tree, "base_footprint", "laser");
  ASSERT_TRUE(up);
  EXPECT_NEAR(up->x, 1.0, 1e-12);
  EXPECT_NEAR(up->y, 2.0, 1e-12);
  EXPECT_NEAR(up->theta, kPi / 2, 1e-12);
  // Two branches of one tree, and the way down.
  ASSERT_TRUE(tree.Set(Link("base_link", "camera", -1.0)));
  EXPECT_NEAR(Find(tree, "camera", "mast")->x, 2.0, 1e-12);
  EXPECT_NEAR(Find(tree, "laser", "base_footprint")->x, -2.0, 1e-12);
  EXPECT_EQ(Find(tree, "laser", "laser")->x, 0.0);
}

TEST(FrameTree, NeverGoesThroughTheOdometry) {
  FrameTree tree;
  ASSERT_TRUE(tree.Set(Link("odom", "base_link", 5.0)));
  ASSERT_TRUE(tree.Set(Link("odom", "laser", 1.0)));
  EXPECT_FALSE(Find(tree, "base_link", "laser"));
}

TEST(FrameTree, ACircleEnds) {
  FrameTree tree;
  ASSERT_TRUE(tree.Set(Link("a", "b", 1.0)));
  ASSERT_TRUE(tree.Set(Link("b", "a", 1.0)));
  EXPECT_FALSE(Find(tree, "base_link", "a"));
}

TEST(FrameTree, RefusesWhatIsNoMotion) {
  FrameTree tree;
  EXPECT_FALSE(tree.Set(Link("a", "a", 1.0)));
  EXPECT_FALSE(tree.Set(Link("", "a", 1.0)));
  EXPECT_FALSE(tree.Set(Link("a", "b", std::nan(""))));
  EXPECT_FALSE(tree.Set(Link("a", "b", 1e9)));
  Transform no_turn = Link("a", "b", 0.0);
  no_turn.T_frame_child.rotation.coeffs().setZero();
  EXPECT_FALSE(tree.Set(no_turn)) << "the quaternion of a message that nobody has filled in";
  EXPECT_EQ(tree.Find("b"), nullptr);
}

TEST(FrameTree, HasABound) {
  FrameTree tree;
  for (std::size_t i = 0; i < FrameTree::kMaxFrames; ++i)
    ASSERT_TRUE(tree.Set(Link("base_link", "frame" + std::to_string(i), 0.0)));
  EXPECT_FALSE(tree.Set(Link("base_link", "one more", 0.0)));
  EXPECT_TRUE(tree.Set(Link("base_link", "frame7", 1.0))) << "a known frame may still change";
}

TEST(FrameTree, OfTwoTreesTheFirstKnowsBetter) {
  FrameTree own, shared;
  ASSERT_TRUE(own.Set(Link("base_link", "laser", 1.0)));
  ASSERT_TRUE(shared.Set(Link("base_link", "laser", 2.0)));
  ASSERT_TRUE(shared.Set(Link("base_footprint", "base_link", 10.0)));
  EXPECT_NEAR(Find(own, "base_footprint", "laser", shared)->x, 11.0, 1e-12);
}

}  // namespace
}  // namespace cairn::ros2
