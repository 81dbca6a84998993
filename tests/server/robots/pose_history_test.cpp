#include "server/robots/pose_history.h"

#include <gtest/gtest.h>

#include <limits>

#include "server/slam/state/archive.h"

namespace cairn::server {
namespace {

PathPose PoseAt(Stamp stamp) {
  const Eigen::Matrix3f covariance = Eigen::Matrix3f::Zero();
  return {stamp, {0.1 * static_cast<double>(stamp), 0, 0}, 0.5F, true, PoseReason::kTracking, covariance, {}};
}

TEST(PoseHistory, InterpolatesBetweenPosesAcrossBlocks) {
  PoseHistory history(100000);
  for (Stamp stamp = 0; stamp < 2000; stamp += 2) history.Append(PoseAt(stamp));
  const PathView view = history.view();
  EXPECT_EQ(view.size(), 1000U);
  for (Stamp stamp = 0; stamp <= 1998; ++stamp) {
    const auto pose = view.At(stamp);
    ASSERT_TRUE(pose) << stamp;
    EXPECT_NEAR(pose->T_map_robot.x, 0.1 * static_cast<double>(stamp), 1e-9);
    EXPECT_EQ(pose->stamp, stamp);
  }
  EXPECT_FALSE(view.At(-1));
  EXPECT_FALSE(view.At(1999));
}

// Stamps are the robot's, and the difference of two may not fit one.
TEST(PoseHistory, InterpolatesBetweenStampsThatAreFarApart) {
  PoseHistory history(100);
  PathPose first = PoseAt(0), last = PoseAt(10);
  first.stamp = std::numeric_limits<Stamp>::min();
  last.stamp = std::numeric_limits<Stamp>::max();
  history.Append(first);
  history.Append(last);
  const auto pose = history.view().At(0);
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->T_map_robot.x, 0.5, 1e-9);
}

TEST(PoseHistory, StampsThatDoNotGrowAreNotReadFromACheckpoint) {
  for (const Stamp second : {5, 4}) {
    slam::StateWriter writer;
    writer(std::vector<std::shared_ptr<const std::vector<PathPose>>>{},
           std::vector<PathPose>{PoseAt(4), PoseAt(second)});
    const std::string bytes = writer.Bytes();
    slam::StateReader reader(bytes);
    PoseHistory history(100);
    reader(history);
    EXPECT_EQ(reader.ok(), second == 5);
  }
}

TEST(PoseHistory, AViewDoesNotChangeAsThePathGrows) {
  PoseHistory history(100000);
  history.Append(PoseAt(1));
  const PathView view = history.view();
  history.Append(PoseAt(2));
  EXPECT_EQ(view.size(), 1U);
  EXPECT_EQ(history.view().size(), 2U);
}

TEST(PoseHistory, StampsThatDoNotIncreaseAreLeftOut) {
  PoseHistory history(100);
  history.Append(PoseAt(5));
  history.Append(PoseAt(5));
  history.Append(PoseAt(4));
  EXPECT_EQ(history.size(), 1U);
}

TEST(PoseHistory, StaysBelowItsBoundAndKeepsBothEnds) {
  PoseHistory history(2048);
  for (Stamp stamp = 1; stamp <= 50000; ++stamp) {
    history.Append(PoseAt(stamp));
    ASSERT_LE(history.size(), 2048U + 1U);
  }
  const PathView view = history.view();
  EXPECT_EQ(view.first_stamp(), 1);
  EXPECT_EQ(view.last_stamp(), 50000);
  EXPECT_NEAR(view.At(20000)->T_map_robot.x, 2000.0, 1e-6);
}

TEST(PoseHistory, AnInterpolatedPoseIsAsGoodAsTheWorseOfTheTwo) {
  PoseHistory history(100);
  history.Append({10, {}, 0.9F, true, PoseReason::kTracking, Eigen::Matrix3f::Identity(), {1, 0, 0}});
  history.Append({20, {}, 0.2F, false, PoseReason::kLost, 3.0F * Eigen::Matrix3f::Identity(), {2, 0, 0}});
  const auto pose = history.view().At(15);
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->score, 0.2F);
  EXPECT_FALSE(pose->localized);
  EXPECT_EQ(pose->reason, PoseReason::kLost);
  EXPECT_FLOAT_EQ(pose->covariance(1, 1), 2.0F);
  EXPECT_DOUBLE_EQ(pose->T_map_odom.x, 1.5);
}

}  // namespace
}  // namespace cairn::server
