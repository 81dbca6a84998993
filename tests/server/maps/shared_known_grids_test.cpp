#include "server/maps/shared_known_grids.h"

#include <gtest/gtest.h>

#include "server/maps/localising_tiles.h"
#include "server/maps/tile_encoding.h"

namespace cairn::server {
namespace {

// Two tiles, of which one has a wall along its first column. They are encoded anew, as for each robot.
std::vector<TileSet::TilePtr> Tiles(std::uint8_t wall = 100) {
  TileCells free, walled;
  free.fill(0);
  walled.fill(0);
  for (std::size_t row = 0; row < kTileCells; ++row) walled[row * kTileCells] = wall;
  return {EncodeTile({0, 0, 0}, walled, 3, 7), EncodeTile({0, 1, 0}, free, 3, 8)};
}

SharedKnownGrids::Grid Make(SharedKnownGrids* shared, std::uint8_t wall = 100, std::uint32_t epoch = 3,
                            double near_m = 0.3) {
  return KnownGridOf(Tiles(wall), 0.05, epoch, {}, near_m, shared);
}

TEST(SharedKnownGrids, WhoIsLocalisedInTheSameMapSharesIt) {
  SharedKnownGrids shared;
  const auto one = Make(&shared);
  ASSERT_FALSE(one->Index()->surfaces.empty());
  EXPECT_EQ(Make(&shared), one);
  EXPECT_NE(Make(nullptr), one);
  EXPECT_EQ(shared.size(), 1U);
}

TEST(SharedKnownGrids, WhatDiffersInAnythingIsAnotherMap) {
  SharedKnownGrids shared;
  const auto one = Make(&shared);
  EXPECT_NE(Make(&shared, 90), one) << "cells";
  EXPECT_NE(Make(&shared, 100, 4), one) << "epoch";
  EXPECT_NE(Make(&shared, 100, 3, 0.4), one) << "options";
  EXPECT_NE(KnownGridOf(Tiles(), 0.1, 3, {}, 0.3, &shared), one) << "side of a cell";
  const slam::PlaceSearchOptions coarse{.cell_scale = 3.0};
  EXPECT_NE(KnownGridOf(Tiles(), 0.05, 3, coarse, 0.3, &shared), one) << "tables";
  std::vector<TileSet::TilePtr> fewer = Tiles();
  fewer.pop_back();
  EXPECT_NE(KnownGridOf(fewer, 0.05, 3, {}, 0.3, &shared), one) << "tiles";
}

TEST(SharedKnownGrids, AMapThatSomebodyMadeAloneGivesWayToTheSame) {
  SharedKnownGrids shared;
  const auto alone = Make(nullptr);
  EXPECT_EQ(shared.SameAs(alone), alone) << "nobody had it";
  EXPECT_EQ(shared.SameAs(Make(nullptr)), alone);
  EXPECT_EQ(Make(&shared), alone);
  EXPECT_EQ(shared.SameAs(alone), alone);
  EXPECT_EQ(shared.size(), 1U);
}

TEST(SharedKnownGrids, AMapIsKeptNoLongerThanSomebodyIsLocalisedInIt) {
  SharedKnownGrids shared;
  auto one = Make(&shared), other = one;
  one.reset();
  EXPECT_EQ(shared.size(), 1U);
  other.reset();
  EXPECT_EQ(shared.size(), 0U);
}

}  // namespace
}  // namespace cairn::server
