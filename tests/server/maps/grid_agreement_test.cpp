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
  return CompareGrids(Drawn(T_said_true), Drawn(), T_said_true * testing::TruePose(50), 0.05);
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

TEST(GridAgreement, WhereOthersHaveSeenNothingNothingIsCompared) {
  const GridAgreement agreement = CompareGrids(Drawn({50.0, 0.0, 0.0}), Drawn(), {50.0, 0.0, 0.0}, 0.05);
  EXPECT_EQ(agreement.compared, 0U);
  EXPECT_FALSE(agreement.Contradicts());
  EXPECT_FALSE(CompareGrids({}, Drawn(), {}, 0.05).Contradicts());
}

TEST(SumOfGrids, AddsWhatIsSeenAndKeepsWhatIsSeenOnce) {
  const auto chunk = [](std::int16_t first, std::int16_t second) {
    auto made = std::make_shared<slam::GridChunk>();
    made->log_odds.fill(slam::kUnseen);
    made->log_odds[0] = first;
    made->log_odds[1] = second;
    return made;
  };
  const OccupancyGrid::Chunks a{{{0, 0}, chunk(100, slam::kUnseen)}},
      b{{{0, 0}, chunk(-30, 40)}, {{1, 0}, chunk(7, 8)}}, c{{{0, 0}, chunk(32000, 5)}};
  const OccupancyGrid::Chunks sum = SumOfGrids({&a, &b, &c});
  ASSERT_EQ(sum.size(), 2U);
  EXPECT_EQ(sum.at({0, 0})->log_odds[0], 32000);
  EXPECT_EQ(sum.at({0, 0})->log_odds[1], 45);
  EXPECT_EQ(sum.at({0, 0})->log_odds[2], slam::kUnseen);
  EXPECT_EQ(sum.at({1, 0}), b.at({1, 0}));
}

}  // namespace
}  // namespace cairn::server
