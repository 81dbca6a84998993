#include "server/slam/voting/pose_from_pairs.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

// A line through `p` in direction `slope`, seen from `pose`.
LineFeature Seen(const Eigen::Vector2d& p, double slope, double length, const Pose2& pose) {
  const Eigen::Vector2d along(std::cos(slope), std::sin(slope));
  const Pose2 to_robot = pose.Inverse();
  LineFeature line;
  line.first = to_robot * Eigen::Vector2d(p - 0.5 * length * along);
  line.last = to_robot * Eigen::Vector2d(p + 0.5 * length * along);
  line.length = length;
  line.slope = WrapAngle(slope + to_robot.theta);
  line.point_count = 20;
  return line;
}

std::vector<LinePair> Diagonal(std::size_t count) {
  std::vector<LinePair> pairs;
  for (int i = 0; i < static_cast<int>(count); ++i) pairs.push_back({.ref = i, .curr = i, .votes = 10});
  return pairs;
}

TEST(RobustMean, Table326SettlesNear207Degrees) {
  const std::vector<double> printed{20.6224, 20.8901, 22.4841, 21.6135, 20.6844, 21.6891, 23.0676, 20.6420};
  std::vector<WeightedVector> values;
  for (const double degrees : printed) values.push_back({.value = {Radians(degrees), 0.0}, .weight = 1.0});
  const PoseOptions options;
  const RobustMean mean =
      MeanWithoutOutliers(values, options.rotation_spread_rad, static_cast<int>(options.rotation_keep));
  EXPECT_NEAR(Degrees(mean.mean.x()), 20.7, 0.05);
  EXPECT_EQ(mean.kept, 4);
}

TEST(RobustMean, KeepsTheNumberAskedForAndWeighsByLength) {
  const std::vector<WeightedVector> values{{{0.0, 0.0}, 3.0}, {{1.0, 0.0}, 1.0}};
  const RobustMean mean = MeanWithoutOutliers(values, 1e-6, 2);
  EXPECT_NEAR(mean.mean.x(), 0.25, 1e-12);
  EXPECT_EQ(MeanWithoutOutliers(values, 1e-6, 1).kept, 1);
  EXPECT_EQ(MeanWithoutOutliers({}, 1.0, 3).kept, 0);
  EXPECT_EQ(MeanWithoutOutliers({{{1.0, 0.0}, 0.0}}, 1.0, 3).kept, 0);
}

TEST(PoseFromPairs, RecoversAMotionFromObliqueLines) {
  const Pose2 motion{0.31, -0.22, 0.35};
  ScanFeatures prev, curr;
  const std::vector<std::pair<Eigen::Vector2d, double>> walls{
      {{3, 0}, Radians(80)}, {{1, 2}, Radians(-170)}, {{0, -2}, Radians(25)}, {{-2, 1}, Radians(-60)}};
  for (const auto& [p, slope] : walls) {
    prev.lines.push_back(Seen(p, slope, 2.0, {}));
    // Another stretch of the same wall.
    curr.lines.push_back(Seen(p + 0.4 * Eigen::Vector2d(std::cos(slope), std::sin(slope)), slope, 1.3, motion));
  }
  const auto pairs = Diagonal(walls.size());
  const PoseOptions options;
  const auto rotation = RotationFromPairs(prev, curr, pairs, options);
  ASSERT_TRUE(rotation);
  EXPECT_NEAR(rotation->rotation_rad, motion.theta, 1e-9);
  const auto offsets = OffsetsOf(prev, curr, pairs, rotation->rotation_rad, options);
  const auto translation = TranslationFromOffsets(offsets, rotation->rotation_rad, {9, 9}, options);
  ASSERT_TRUE(translation);
  EXPECT_FALSE(translation->degenerate);
  EXPECT_NEAR((translation->translation - motion.translation()).norm(), 0.0, 1e-9);
}

TEST(PoseFromPairs, AveragesRotationsAcrossHalfATurn) {
  ScanFeatures prev, curr;
  for (const double off : {-0.001, 0.001}) {
    prev.lines.push_back(Seen({3, 0}, kPi / 2, 2.0, {}));
    curr.lines.push_back(Seen({3, 0}, kPi / 2, 2.0, {0, 0, kPi + off}));
  }
  const auto rotation = RotationFromPairs(prev, curr, Diagonal(2), PoseOptions{});
  ASSERT_TRUE(rotation);
  EXPECT_NEAR(std::abs(rotation->rotation_rad), kPi, 1e-9);
}

TEST(PoseFromPairs, OneWrongPairDoesNotMoveTheAnswer) {
  const Pose2 motion{0.2, 0.1, 0.1};
  ScanFeatures prev, curr;
  for (const auto& [p, slope] : std::vector<std::pair<Eigen::Vector2d, double>>{
           {{3, 0}, kPi / 2}, {{0, 2}, kPi}, {{0, -2}, 0.0}, {{3.5, 1}, kPi / 2}, {{1, 2.4}, kPi}}) {
    prev.lines.push_back(Seen(p, slope, 2.0, {}));
    curr.lines.push_back(Seen(p, slope, 2.0, motion));
  }
  curr.lines[4] = Seen({1, 2.9}, kPi + 0.03, 2.0, motion);
  const auto pairs = Diagonal(5);
  const auto rotation = RotationFromPairs(prev, curr, pairs, PoseOptions{});
  ASSERT_TRUE(rotation);
  EXPECT_NEAR(rotation->rotation_rad, motion.theta, 1e-9);
  const auto translation = TranslationFromOffsets(OffsetsOf(prev, curr, pairs, rotation->rotation_rad, PoseOptions{}),
                                                  rotation->rotation_rad, {0, 0}, PoseOptions{});
  ASSERT_TRUE(translation);
  EXPECT_NEAR((translation->translation - motion.translation()).norm(), 0.0, 1e-9);
}

TEST(PoseFromPairs, ACorridorLeavesItsDirectionToOdometry) {
  const Pose2 motion{0.3, 0.05, 0.04};
  for (const double heading : {0.0, Radians(45), Radians(90), Radians(130)}) {
    const Pose2 a{0, 0, heading}, b = a * motion;
    ScanFeatures prev, curr;
    prev.lines = {Seen({1, -1}, 0.0, 6.0, a), Seen({2, 1}, kPi, 5.0, a)};
    curr.lines = {Seen({2, -1}, 0.0, 6.0, b), Seen({1, 1}, kPi, 5.0, b)};
    const Eigen::Vector2d odometry = motion.translation() + Eigen::Vector2d(0.02, 0.03);
    const auto rotation = RotationFromPairs(prev, curr, Diagonal(2), PoseOptions{});
    ASSERT_TRUE(rotation);
    const auto translation =
        TranslationFromOffsets(OffsetsOf(prev, curr, Diagonal(2), rotation->rotation_rad, PoseOptions{}),
                               rotation->rotation_rad, odometry, PoseOptions{});
    ASSERT_TRUE(translation);
    EXPECT_TRUE(translation->degenerate);
    const Eigen::Vector2d along(std::cos(heading), -std::sin(heading)), across(along.y(), -along.x());
    EXPECT_NEAR(std::abs(translation->along.dot(along)), 1.0, 1e-9);
    EXPECT_NEAR(translation->translation.dot(across), motion.translation().dot(across), 1e-9);
    EXPECT_NEAR(translation->translation.dot(along), odometry.dot(along), 1e-9);
  }
}

TEST(PoseFromPairs, NoPairsNoAnswer) {
  EXPECT_FALSE(RotationFromPairs({}, {}, {}, PoseOptions{}));
  EXPECT_FALSE(TranslationFromOffsets({}, 0.0, {0, 0}, PoseOptions{}));
}

}  // namespace
}  // namespace cairn::slam
