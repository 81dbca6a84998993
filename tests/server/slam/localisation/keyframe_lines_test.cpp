#include "server/slam/localisation/keyframe_lines.h"

#include <gtest/gtest.h>

#include "server/slam/features/feature_extraction.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

Keyframe Looked(const test::World& world, const Pose2& T_map_robot) {
  return {std::make_shared<const Scan>(test::Look(world, T_map_robot, test::FullTurnLaser(720))), {}};
}

TEST(KeyframeLines, TheSidesOfARoomSeenFromInside) {
  const test::World room = test::Room(-3, -2, 6, 4);
  const std::vector<Pose2> path{{0.5, 0.2, 0.3}, {-1.0, -0.4, 2.5}, {1.5, 0.8, -1.2}};
  std::vector<Keyframe> keyframes;
  for (const Pose2& T : path) keyframes.push_back(Looked(room, T));
  const std::vector<MapLine> lines = LinesOfKeyframes(keyframes, path);
  ASSERT_EQ(lines.size(), 4U);
  EXPECT_NEAR((lines[0].b - lines[0].a).norm(), 6.0, 0.1);  // The longest first.
  EXPECT_NEAR((lines[3].b - lines[3].a).norm(), 4.0, 0.1);
  for (const MapLine& line : lines) {
    const Eigen::Vector2d along = (line.b - line.a).normalized(), left(-along.y(), along.x());
    EXPECT_NEAR(left.dot(-line.a), std::abs(along.x()) > 0.7 ? 2.0 : 3.0, 0.03) << "the middle is on the left";
  }
}

TEST(KeyframeLines, WhatOneKeyframeAloneSawIsLeftOut) {
  const test::World room = test::Room(-3, -2, 6, 4);
  EXPECT_TRUE(LinesOfKeyframes(std::vector{Looked(room, {})}, std::vector<Pose2>{{}}).empty());
  EXPECT_TRUE(LinesOfKeyframes({}, {}).empty());
}

TEST(KeyframeLines, ThereAndBackALineIsTheSame) {
  const auto lines = ExtractFeatures(test::Look(test::Office(), {}, {}), FeatureOptions{}).lines;
  ASSERT_FALSE(lines.empty());
  const Pose2 T{2.0, -1.0, 2.2};
  for (const LineFeature& line : lines) {
    const LineFeature back = LineIn(T.Inverse(), LineIn(T, line));
    EXPECT_LT((back.first - line.first).norm() + (back.last - line.last).norm(), 1e-9);
    EXPECT_NEAR(AngleDiff(back.slope, line.slope), 0.0, 1e-9);
    EXPECT_NEAR(back.distance, line.distance, 1e-6);
    EXPECT_NEAR(AngleDiff(back.normal_angle, line.normal_angle), 0.0, 1e-6);
  }
}

}  // namespace
}  // namespace cairn::slam
