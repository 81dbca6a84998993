#include "server/maps/joint_map.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "server/maps/layer_sum.h"

namespace cairn::server {
namespace {

constexpr double kPast = 0.8;

std::shared_ptr<const slam::GridChunk> ChunkOf(std::int16_t log_odds, std::size_t cells = kTileArea) {
  auto chunk = std::make_shared<slam::GridChunk>();
  chunk->log_odds.fill(slam::kUnseen);
  std::fill_n(chunk->log_odds.begin(), cells, log_odds);
  return chunk;
}

TEST(JointMap, EvidenceOfSeveralRobotsAdds) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(100, 2)}}});
  map.Apply({.session = 2, .chunks = {{{0, 0}, ChunkOf(50, 1)}}});
  map.Render();
  const TileCells& cells = *map.cells().at({0, 0, 0});
  EXPECT_EQ(cells[0], slam::OccupancyOf(150));
  EXPECT_EQ(cells[1], slam::OccupancyOf(100));
  EXPECT_EQ(cells[2], kUnknownCell);
}

TEST(JointMap, ContraryEvidenceCancelsWhereNobodyKnowsWhoLookedLast) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(200)}}});
  map.Apply({.session = 2, .chunks = {{{0, 0}, ChunkOf(-200)}}});
  map.Render();
  EXPECT_EQ((*map.cells().at({0, 0, 0}))[0], 50);
}

slam::CellMask MaskOf(std::initializer_list<std::size_t> cells) {
  slam::CellMask mask;
  for (const std::size_t cell : cells) {
    slam::ScanRaster::Piece marks{};
    marks[cell % marks.size()] = slam::ScanRaster::kHit;
    mask.AddTouched(cell - cell % marks.size(), marks);
  }
  return mask;
}

// Two robots have mapped for hours. One of them sees that a pallet is gone, and later the other one that it is back.
TEST(JointMap, OfTwoRobotsThatGoOnTheOneThatLookedLastIsBelieved) {
  const std::int16_t wall = 389, miss = slam::LogOddsOf(slam::GridOptions{}.miss_probability);
  JointMap map(kPast);
  const auto looks = [&map](SessionId session, std::int16_t log_odds, std::initializer_list<std::size_t> cells) {
    map.Apply({.session = session, .chunks = {{{0, 0}, ChunkOf(log_odds)}}, .looks = {{{0, 0}, MaskOf(cells)}}});
    map.Render();
  };
  const auto cell = [&map](std::size_t index) { return (*map.cells().at({0, 0, 0}))[index]; };
  looks(1, wall, {0, 20});
  looks(2, wall, {0, 20});
  looks(2, static_cast<std::int16_t>(6 * miss), {0});
  EXPECT_LT(cell(0), 50);
  looks(2, -wall, {0});
  EXPECT_LT(cell(0), 10);
  EXPECT_EQ(cell(20), 8) << "the second was the last to look here as well";
  EXPECT_EQ(cell(40), 50) << "nobody is known to have looked here last";
  looks(1, wall, {0});  // Its cell has not changed, because it held the most before.
  EXPECT_GT(cell(0), 90);
  map.SetPast(1);
  map.Render();
  EXPECT_GT(cell(0), 90) << "it has ended, and has still looked last";
  EXPECT_EQ(cell(20), 8);
  map.SetPast(2);
  map.MergePast(1, 2);
  map.Render();
  EXPECT_GT(cell(0), 90) << "of the two that are one now, the first had looked last here";
  EXPECT_EQ(cell(20), 8) << "and the second here";
  map.Remove(2);
  map.Render();
  EXPECT_TRUE(map.cells().empty());
}

// After a correction that has hardly moved it, as a job makes one every 200 m.
TEST(JointMap, AGridThatIsDrawnAgainIsStillTheOneThatLookedLastWhereItSaysTheSame) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(300)}}, .looks = {{{0, 0}, MaskOf({0, 1, 2})}}});
  map.Apply({.session = 2, .chunks = {{{0, 0}, ChunkOf(-300)}}, .looks = {{{0, 0}, MaskOf({0, 1, 2})}}});
  const auto cell = [&map](std::size_t index) {
    map.Render();
    return (*map.cells().at({0, 0, 0}))[index];
  };
  ASSERT_LT(cell(0), 30);
  auto again = std::make_shared<slam::GridChunk>(*ChunkOf(-250));
  again->log_odds[1] = 250;
  again->log_odds[2] = slam::kUnseen;
  map.Replace(2, {{{0, 0}, again}});
  EXPECT_LT(cell(0), 30);
  EXPECT_GT(cell(1), 90) << "it says something else";
  EXPECT_GT(cell(2), 90) << "it has not seen this";
  map.Replace(1, {{{0, 0}, ChunkOf(280)}});
  EXPECT_LT(cell(0), 30) << "the other one was the last";
  map.Replace(2, {{{1, 0}, again}});
  EXPECT_GT(cell(0), 90) << "it has drawn nothing there";
}

// What a session with a frame of its own has looked at is somewhere else, and so is what was drawn again.
TEST(JointMap, LooksOfAHiddenSessionDoNotCount) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(300)}}});
  map.SetHidden(2, true);
  map.Apply({.session = 2, .chunks = {{{0, 0}, ChunkOf(-300)}}, .looks = {{{0, 0}, MaskOf({0})}}});
  map.SetHidden(2, false);
  map.Render();
  EXPECT_EQ((*map.cells().at({0, 0, 0}))[0], 50);
}

TEST(LastLooks, TheLastOfMoreSessionsThanAByteCountsIsKnown) {
  LastLooks last;
  for (SessionId session = 1; session <= 300; ++session) last.Note(session, MaskOf({session}));
  EXPECT_EQ(last.NumberOf(1), 0) << "the first ones are forgotten";
  EXPECT_EQ(last.numbers()[1], 0);
  EXPECT_EQ(last.numbers()[300], last.NumberOf(300));
  EXPECT_NE(last.NumberOf(300), 0);
  EXPECT_EQ(last.numbers()[200], last.NumberOf(200));
  last.Replace(300, 200);
  EXPECT_EQ(last.NumberOf(300), 0);
  EXPECT_EQ(last.numbers()[300], last.NumberOf(200));
}

// Two ended sessions have often seen a wall. A robot of today has seen six times that it is not there.
TEST(JointMap, WhatWasMovedSinceTheLastRunsIsGoneAfterAFewLooks) {
  const std::int16_t wall = 389, miss = slam::LogOddsOf(slam::GridOptions{}.miss_probability);
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(wall)}}});
  map.Apply({.session = 2, .chunks = {{{0, 0}, ChunkOf(wall)}}});
  map.Apply({.session = 3, .chunks = {{{0, 0}, ChunkOf(static_cast<std::int16_t>(6 * miss), 1)}}});
  map.Render();
  EXPECT_GT((*map.cells().at({0, 0, 0}))[0], 90);
  map.SetPast(1);
  map.SetPast(2);
  EXPECT_FALSE(map.Render().empty());
  EXPECT_LT((*map.cells().at({0, 0, 0}))[0], 50);
  EXPECT_GT((*map.cells().at({0, 0, 0}))[1], 98);  // Nobody has looked there since.
  // One look is not enough.
  map.Apply({.session = 3, .chunks = {{{0, 0}, ChunkOf(miss, 1)}}});
  map.Render();
  EXPECT_GT((*map.cells().at({0, 0, 0}))[0], 70);
  // What the last run has seen counts more than the runs before, also after it has ended.
  map.Apply({.session = 3, .chunks = {{{0, 0}, ChunkOf(-389, 1)}}});
  map.SetPast(3);
  map.Render();
  EXPECT_LT((*map.cells().at({0, 0, 0}))[0], 10);
}

// A robot that was there for a week, while another one came and went, has seen the newest state.
TEST(JointMap, OfSessionsThatHaveEndedTheOneThatEndedLastIsTheLatest) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(-389)}}});
  map.Apply({.session = 2, .chunks = {{{0, 0}, ChunkOf(389)}}});
  map.SetPast(2);
  map.SetPast(1);
  map.SetPast(2);  // Again, as after a restart.
  map.Render();
  EXPECT_LT((*map.cells().at({0, 0, 0}))[0], 10);
  EXPECT_EQ(map.past(), (std::vector<SessionId>{2, 1}));
}

TEST(LayerSum, CellsThatOnlyOneHasSeenAreKeptAndSumsAreBounded) {
  slam::GridChunk sum = UnseenChunk();
  const auto add = [&sum](std::int16_t first, std::int16_t second) {
    slam::GridChunk other = UnseenChunk();
    other.log_odds[0] = first;
    other.log_odds[1] = second;
    AddBeside(sum, other);
  };
  add(100, slam::kUnseen);
  add(-30, 40);
  EXPECT_EQ(sum.log_odds[0], 70);
  EXPECT_EQ(sum.log_odds[1], 40);
  EXPECT_EQ(sum.log_odds[2], slam::kUnseen);
  add(32000, 5);
  EXPECT_EQ(sum.log_odds[0], 32000);
  slam::GridChunk later = UnseenChunk();
  later.log_odds[0] = -50;
  AddLater(sum, later, 139);
  EXPECT_EQ(sum.log_odds[0], 89);
  EXPECT_EQ(sum.log_odds[1], 45);
}

TEST(JointMap, WhereSessionsDifferIsALayerOfItsOwn) {
  JointMap map(kPast);
  const std::int16_t wall = 300, free = -300;
  auto first = std::make_shared<slam::GridChunk>(*ChunkOf(free)), second = std::make_shared<slam::GridChunk>(*first);
  const auto at = [](std::size_t column, std::size_t row) { return row * kTileCells + column; };
  second->log_odds[at(10, 10)] = wall;  // The first has seen no wall near it.
  first->log_odds[at(50, 50)] = wall;   // A wall that they have placed in neighbouring cells.
  second->log_odds[at(51, 49)] = wall;
  first->log_odds[at(90, 90)] = slam::kUnseen;
  second->log_odds[at(0, 70)] = wall;  // At the border.
  map.Apply({.session = 1, .chunks = {{{0, 0}, first}, {{1, 0}, ChunkOf(wall)}}});
  EXPECT_TRUE(map.RenderDisagreement().empty());
  map.Apply({.session = 2, .chunks = {{{0, 0}, second}}});
  EXPECT_EQ(map.RenderDisagreement(), (std::vector<TileKey>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}));
  const TileCells& cells = *map.disagreement().at({0, 0, 0});
  EXPECT_EQ(cells[at(10, 10)], slam::OccupancyOf(wall) - slam::OccupancyOf(free));
  EXPECT_EQ(cells[at(11, 10)], 0);
  EXPECT_EQ(cells[at(50, 50)], 0);
  EXPECT_EQ(cells[at(51, 49)], 0);
  EXPECT_EQ(cells[at(90, 90)], kUnknownCell) << "only one has seen it";
  EXPECT_EQ(cells[at(0, 70)], kUnknownCell) << "its neighbours are in another chunk";
  EXPECT_FALSE(map.disagreement().contains({0, 1, 0}));
  map.SetHidden(2, true);
  EXPECT_EQ(map.RenderDisagreement().size(), 4U);
  EXPECT_TRUE(map.disagreement().empty());
  map.SetHidden(2, false);
  EXPECT_EQ(map.RenderDisagreement().size(), 4U);
  map.SetPast(1);  // It still counts: this is how a change since the last run shows.
  EXPECT_TRUE(map.RenderDisagreement().empty());
  EXPECT_FALSE(map.disagreement().empty());
  map.ForgetDisagreement();
  EXPECT_TRUE(map.disagreement().empty());
  EXPECT_EQ(map.RenderDisagreement().size(), 4U);
  map.SetPast(2);
  map.MergePast(1, 2);  // Both are one layer now.
  EXPECT_EQ(map.RenderDisagreement().size(), 4U);
  EXPECT_TRUE(map.disagreement().empty());
}

TEST(JointMap, WhereSessionsDifferByLessThanHalfThereIsNoTile) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(0)}}});
  map.Apply({.session = 2, .chunks = {{{0, 0}, ChunkOf(300)}}});
  EXPECT_TRUE(map.RenderDisagreement().empty());
}

TEST(JointMap, AHiddenSessionIsKeptAndNotShown) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(100, 2)}}});
  map.SetHidden(2, true);
  map.Apply({.session = 2, .chunks = {{{0, 0}, ChunkOf(50, 1)}, {{1, 0}, ChunkOf(50)}}});
  map.Render();
  EXPECT_EQ((*map.cells().at({0, 0, 0}))[0], slam::OccupancyOf(100));
  EXPECT_FALSE(map.cells().contains({0, 1, 0}));
  EXPECT_EQ(map.ChunksOf(2).size(), 2U);
  map.SetHidden(2, false);
  EXPECT_FALSE(map.Render().empty());
  EXPECT_EQ((*map.cells().at({0, 0, 0}))[0], slam::OccupancyOf(150));
  EXPECT_TRUE(map.cells().contains({0, 1, 0}));
  map.SetHidden(2, true);
  EXPECT_FALSE(map.Render().empty());
  EXPECT_FALSE(map.cells().contains({0, 1, 0}));
}

TEST(JointMap, RenderNamesWhatChangedOnEveryLevelOnce) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(100)}, {{1, 0}, ChunkOf(100)}}});
  const auto changed = map.Render();
  // Two tiles of level 0 share their parents on levels 1 to 3.
  EXPECT_EQ(changed, (std::vector<TileKey>{{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}));
  EXPECT_TRUE(map.Render().empty());
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(100)}}});  // The same cells again.
  EXPECT_TRUE(map.Render().empty());
}

TEST(JointMap, TilesLeftOfTheOriginHaveParentsLeftOfTheOrigin) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{-1, -3}, ChunkOf(100)}}});
  map.Render();
  EXPECT_TRUE(map.cells().contains({1, -1, -2}));
  EXPECT_TRUE(map.cells().contains({2, -1, -1}));
  EXPECT_TRUE(map.cells().contains({3, -1, -1}));
}

TEST(JointMap, AChunkThatGoesTakesItsTileWithIt) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(100)}}});
  map.Render();
  map.Apply({.session = 1, .chunks = {{{0, 0}, nullptr}}});
  EXPECT_EQ(map.Render().size(), 4U);
  EXPECT_TRUE(map.cells().empty());
}

TEST(JointMap, ReplaceRemovesWhatTheNewGridDoesNotHave) {
  JointMap map(kPast);
  map.Apply({.session = 1, .chunks = {{{0, 0}, ChunkOf(100)}, {{5, 5}, ChunkOf(100)}}});
  map.Apply({.session = 2, .chunks = {{{5, 5}, ChunkOf(70)}}});
  map.Render();
  map.Replace(1, {{{0, 0}, ChunkOf(-100)}});
  map.Render();
  EXPECT_EQ((*map.cells().at({0, 0, 0}))[0], slam::OccupancyOf(-100));
  EXPECT_EQ((*map.cells().at({0, 5, 5}))[0], slam::OccupancyOf(70));
  EXPECT_EQ(map.ChunksOf(1).size(), 1U);
}

// The first sessions that have ended, as one layer: the map shows the same, and goes on as before.
TEST(JointMap, MergedLayersShowWhatTheyShowedOneByOne) {
  std::mt19937 random(5);
  JointMap apart(kPast), merged(kPast);
  for (SessionId session = 1; session <= 6; ++session) {
    for (int i = 0; i < 6; ++i) {
      const slam::ChunkKey key{static_cast<int>(random() % 3), static_cast<int>(random() % 3)};
      const auto chunk = ChunkOf(static_cast<std::int16_t>(random() % 800) - 400, random() % kTileArea);
      for (JointMap* const map : {&apart, &merged}) map->Apply({.session = session, .chunks = {{key, chunk}}});
    }
    for (JointMap* const map : {&apart, &merged}) {
      map->SetHidden(session, session == 2);
      if (session <= 5) map->SetPast(session);
      map->Render();
    }
  }
  merged.MergePast(1, 3);
  EXPECT_TRUE(merged.Render().empty()) << "nothing changes where only a hidden one has ended between the two";
  merged.MergePast(3, 4);
  EXPECT_EQ(merged.past(), (std::vector<SessionId>{4, 2, 5}));
  EXPECT_TRUE(merged.ChunksOf(1).empty() && merged.ChunksOf(3).empty());
  const auto expect_same = [&] {
    apart.Render();
    merged.Render();
    ASSERT_EQ(apart.cells().size(), merged.cells().size());
    for (const auto& [key, cells] : apart.cells()) EXPECT_EQ(*merged.cells().at(key), *cells);
  };
  expect_same();
  for (JointMap* const map : {&apart, &merged}) {
    for (int x = 0; x < 3; ++x) map->Apply({.session = 7, .chunks = {{{x, 1}, ChunkOf(-150)}}});
    map->SetPast(6);
  }
  expect_same();
  merged.Remove(2);
  EXPECT_EQ(merged.past(), (std::vector<SessionId>{4, 5, 6}));
  EXPECT_TRUE(merged.hidden().empty());
  expect_same();
}

// Property: changes applied one by one give the map that a fresh one gives from the final chunks.
TEST(JointMap, StepByStepEqualsFromScratch) {
  std::mt19937 random(3);
  JointMap stepwise(kPast);
  std::map<SessionId, slam::OccupancyGrid::Chunks> latest;
  for (int i = 0; i < 200; ++i) {
    const SessionId session = random() % 3;
    const slam::ChunkKey key{static_cast<int>(random() % 5) - 2, static_cast<int>(random() % 5) - 2};
    const bool gone = random() % 4 == 0;
    const auto chunk = gone ? nullptr : ChunkOf(static_cast<std::int16_t>(random() % 400) - 200, random() % kTileArea);
    stepwise.Apply({.session = session, .chunks = {{key, chunk}}});
    if (gone) {
      latest[session].erase(key);
    } else {
      latest[session][key] = chunk;
    }
    if (i % 11 == 0) stepwise.SetHidden(session, random() % 2 == 0);
    if (i == 60 || i == 130) stepwise.SetPast(session);
    if (i % 7 == 0) stepwise.Render();
  }
  stepwise.Render();
  JointMap fresh(kPast);
  for (const SessionId session : stepwise.past()) fresh.SetPast(session);
  for (const SessionId session : stepwise.hidden()) fresh.SetHidden(session, true);
  for (const auto& [session, chunks] : latest) fresh.Replace(session, chunks);
  fresh.Render();
  ASSERT_EQ(stepwise.cells().size(), fresh.cells().size());
  for (const auto& [key, cells] : fresh.cells()) {
    ASSERT_TRUE(stepwise.cells().contains(key));
    EXPECT_EQ(*stepwise.cells().at(key), *cells);
  }
}

}  // namespace
}  // namespace cairn::server
