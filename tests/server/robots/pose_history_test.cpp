#include "server/robots/pose_history.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

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

// The path lies along the x axis. Around its end the map is moved by 10 m and turned by half a radian.
TEST(PoseHistory, ACorrectionMovesThePosesBetweenTwoKeyframesWithBoth) {
  PoseHistory history(100000);
  for (Stamp stamp = 0; stamp <= 1200; ++stamp) history.Append(PoseAt(stamp));
  const PathView before = history.view();
  const std::vector<StampedPose> now = {{500, {50, 0, 0}}, {1000, {100, 10, 0.5}}, {5000, {0, 0, 0}}};
  history.MoveOnto(now, true, {});
  const PathView after = history.view();
  EXPECT_EQ(before.At(1000)->T_map_robot, (Pose2{100, 0, 0}));
  EXPECT_EQ(after.size(), before.size());
  for (const Stamp stamp : {0, 300, 500}) EXPECT_EQ(after.At(stamp)->T_map_robot, before.At(stamp)->T_map_robot);
  EXPECT_NEAR(after.At(1000)->T_map_robot.y, 10.0, 1e-9);
  EXPECT_NEAR(after.At(1000)->T_map_robot.theta, 0.5, 1e-9);
  // Half way: half from where the map stayed, half from where it was turned.
  EXPECT_NEAR(after.At(750)->T_map_robot.x, 0.5 * (75.0 + 100.0 - 25.0 * std::cos(0.5)), 1e-9);
  EXPECT_NEAR(after.At(750)->T_map_robot.theta, 0.25, 1e-9);
  EXPECT_NEAR(after.At(1100)->T_map_robot.y, 10.0 + 10.0 * std::sin(0.5), 1e-9);
  // Read piece by piece it is the same.
  std::size_t compared = 0;
  for (std::size_t i = 0; i < after.blocks(); ++i) {
    for (const PathPose& pose : after.block(i)) {
      EXPECT_EQ(pose.T_map_robot, history.view().At(pose.stamp)->T_map_robot);
      ++compared;
    }
  }
  EXPECT_EQ(compared, 1201U);
}

// Somebody who reads the path seldom, or never, gets the same as one who reads it after each correction.
TEST(PoseHistory, ManyCorrectionsThatNobodyHasAskedForAreNotLost) {
  PoseHistory read(100000), unread(100000);
  for (PoseHistory* const one : {&read, &unread})
    for (Stamp stamp = 0; stamp <= 2000; ++stamp) one->Append(PoseAt(stamp));
  for (int correction = 1; correction <= 40; ++correction) {
    const std::vector<StampedPose> now = {{100, {10.0, 0.0, 0.0}},
                                          {1900, {190.0, 0.5 * correction, 0.01 * correction}}};
    for (PoseHistory* const one : {&read, &unread}) one->MoveOnto(now, true, {});
    const PathView view = read.view();
    for (std::size_t i = 0; i < view.blocks(); ++i) static_cast<void>(view.block(i));
  }
  EXPECT_NEAR(unread.view().At(1900)->T_map_robot.y, 20.0, 1e-6);
  for (Stamp stamp = 0; stamp <= 2000; stamp += 7)
    EXPECT_EQ(read.view().At(stamp)->T_map_robot, unread.view().At(stamp)->T_map_robot) << stamp;
}

TEST(PoseHistory, WhatFollowsTheLastKeyframeStaysWhereItDoesNotHangOnIt) {
  for (const bool moves_rest : {true, false}) {
    PoseHistory history(100000);
    for (Stamp stamp = 0; stamp <= 600; ++stamp) history.Append(PoseAt(stamp));
    const std::vector<StampedPose> now = {{300, {30, 2, 0}}};
    history.MoveOnto(now, moves_rest, {});
    EXPECT_NEAR(history.view().At(200)->T_map_robot.y, 2.0, 1e-9);
    EXPECT_NEAR(history.view().At(590)->T_map_robot.y, moves_rest ? 2.0 : 0.0, 1e-9);
  }
}

TEST(PoseHistory, ACheckpointHoldsThePosesWhereTheyLieNow) {
  PoseHistory history(100000);
  for (Stamp stamp = 0; stamp <= 600; ++stamp) history.Append(PoseAt(stamp));
  const std::vector<StampedPose> now = {{0, {0, 2, 0}}};
  history.MoveOnto(now, true, true);
  slam::StateWriter writer;
  writer(history);
  const std::string bytes = writer.Bytes();
  slam::StateReader reader(bytes);
  PoseHistory loaded(100000);
  reader(loaded);
  ASSERT_TRUE(reader.ok());
  for (const Stamp stamp : {0, 255, 256, 600}) {
    const auto pose = loaded.view().At(stamp);
    EXPECT_NEAR(pose->T_map_robot.y, 2.0, 1e-9);
    EXPECT_FALSE(pose->localized);
    EXPECT_EQ(pose->reason, PoseReason::kNotJoined);
  }
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
