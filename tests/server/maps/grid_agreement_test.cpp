#include "server/maps/grid_agreement.h"

#include <gtest/gtest.h>

#include "tests/server/support/room_world.h"

namespace cairn::server {
namespace {

using slam::OccupancyGrid;

// What a robot draws of the room whose poses are all displaced like this from the true ones.
OccupancyGrid::Chunks Drawn(const Pose2& T_said_true = {}) {
  OccupancyGrid grid{slam::GridOptions{}};
  for (int step = 0; step < 100; step += 4) grid.Draw(testing::RoomScan(step), T_said_true * testing::TruePose(step));
  return grid.Share();
}

GridAgreement Compared(const Pose2& T_said_true) {
  return CompareGrids(Drawn(T_said_true), Drawn(), T_said_true * testing::TruePose(0), 0.05);
}

TEST(GridAgreement, WhatIsDrawnInTheSamePlaceAgrees) {
  const GridAgreement agreement = Compared({});
  EXPECT_GT(agreement.compared, 200U);
  EXPECT_LT(agreement.contradicted_share(), 0.02);
  EXPECT_FALSE(agreement.Contradicts());
}

TEST(GridAgreement, AStartIsAllowedToBeInexact) {
  for (const Pose2& inexact : {Pose2{0.3, 0.0, 0.0}, Pose2{-0.2, 0.25, 0.05}, Pose2{0.1, 0.1, -0.1}})
    EXPECT_LT(Compared(inexact).contradicted_share(), 0.1) << inexact.x;
}

TEST(GridAgreement, WhatIsDrawnElsewhereContradicts) {
  for (const Pose2& wrong : {Pose2{2.0, 1.5, 0.0}, Pose2{0.0, 0.0, 0.6}, Pose2{-1.5, 1.5, 0.3}})
    EXPECT_TRUE(Compared(wrong).Contradicts()) << wrong.x << ": " << Compared(wrong).contradicted_share();
}

// An error of the heading where it has begun moves what it sees 12 m on by 1.2 m.
TEST(GridAgreement, AnErrorOfTheHeadingCountsFromTheStart) {
  const Pose2 start{12.0, 0.0, 0.0};
  const Pose2 turned = start * Pose2{0.0, 0.0, 0.1} * start.Inverse();
  EXPECT_LT(CompareGrids(Drawn(turned), Drawn(), start, 0.05).contradicted_share(), 0.05);
  EXPECT_GT(CompareGrids(Drawn(turned), Drawn(), turned * testing::TruePose(0), 0.05).contradicted_share(), 0.05);
}

// A wall straight through what the robot has seen to be free; its own walls lie where nobody has looked.
TEST(GridAgreement, AWallOfOthersWhereTheRobotHasDrivenContradicts) {
  OccupancyGrid others{slam::GridOptions{}};
  Scan wall = testing::RoomScan(0);
  for (float& range_m : wall.ranges_m) range_m = 2.5F;
  for (int i = 0; i < 5; ++i) others.Draw(wall, testing::TruePose(0));
  EXPECT_TRUE(CompareGrids(Drawn(), others.Share(), testing::TruePose(0), 0.05).Contradicts());
}

TEST(GridAgreement, WhereOthersHaveSeenNothingNothingIsCompared) {
  const GridAgreement agreement = CompareGrids(Drawn({50.0, 0.0, 0.0}), Drawn(), {50.0, 0.0, 0.0}, 0.05);
  EXPECT_EQ(agreement.compared, 0U);
  EXPECT_FALSE(agreement.Contradicts());
  EXPECT_FALSE(CompareGrids({}, Drawn(), {}, 0.05).Contradicts());
}

}  // namespace
}  // namespace cairn::server
