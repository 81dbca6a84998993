#include "server/egress/unsent.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

OutboundValue StateOf(NameId robot, SessionPhase phase = SessionPhase::kActive) {
  SessionState state;
  state.robot_id = robot;
  state.phase = phase;
  return state;
}

TEST(Unsent, KeepsTheNewestFormOfEachState) {
  Unsent unsent;
  EXPECT_TRUE(unsent.empty());
  EXPECT_TRUE(unsent.Keep(StateOf(1)));
  EXPECT_TRUE(unsent.Keep(StateOf(2)));
  EXPECT_TRUE(unsent.Keep(StateOf(1, SessionPhase::kEnded)));
  EXPECT_EQ(unsent.size(), 2U);
  const auto first = unsent.After({});
  ASSERT_TRUE(first);
  EXPECT_EQ(std::get<SessionState>(*first).phase, SessionPhase::kEnded);
  const auto second = unsent.After(Unsent::KeyOf(*first));
  ASSERT_TRUE(second);
  EXPECT_EQ(std::get<SessionState>(*second).robot_id, 2U);
  EXPECT_FALSE(unsent.After(Unsent::KeyOf(*second)));
  unsent.Forget(StateOf(1));
  EXPECT_EQ(unsent.size(), 1U);
}

TEST(Unsent, WhatIsRetiredReplacesWhatItWas) {
  Unsent unsent;
  EXPECT_TRUE(unsent.Keep(StateOf(1)));
  EXPECT_TRUE(unsent.Keep(Retired{std::get<SessionState>(StateOf(1))}));
  EXPECT_EQ(unsent.size(), 1U);
  EXPECT_TRUE(std::holds_alternative<Retired>(*unsent.After({})));
  unsent.Forget(StateOf(1));
  EXPECT_TRUE(unsent.empty());
}

TEST(Unsent, KeepsNothingThatIsNoState) {
  Unsent unsent;
  EXPECT_FALSE(unsent.Keep(PoseReport{}));
  EXPECT_FALSE(unsent.Keep(Reply{}));
  EXPECT_FALSE(unsent.Keep(SessionRefusal{}));
  EXPECT_TRUE(unsent.empty());
}

TEST(Unsent, TilesOfEveryPlaceHaveKeysOfTheirOwn) {
  Unsent unsent;
  TileSample sample;
  sample.site_id = 1;
  for (const TileKey& key : {TileKey{0, 1, -1}, TileKey{0, -1, 1}, TileKey{1, 1, -1}, TileKey{0, 0, -1}}) {
    sample.tile.key = key;
    EXPECT_TRUE(unsent.Keep(sample));
  }
  EXPECT_EQ(unsent.size(), 4U);
}

}  // namespace
}  // namespace cairn::server
