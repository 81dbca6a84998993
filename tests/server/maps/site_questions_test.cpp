// What a site makes of its map only when somebody asks for it.
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>

#include "server/slam/grid/occupancy_grid.h"
#include "tests/server/maps/site_sessions.h"

namespace cairn::server {
namespace {

class SiteQuestions : public testing::SiteTest {
 protected:
  using Snapshot = std::shared_ptr<const MapSnapshot>;
  Snapshot Disagreement() {
    std::promise<Snapshot> answer;
    site_->AskDisagreement([&](Result<Snapshot> map) { answer.set_value(map ? *std::move(map) : nullptr); });
    return answer.get_future().get();
  }
  Snapshot PartOf(SessionId session, int level) {
    std::promise<Snapshot> answer;
    site_->AskPartOf(session, level, [&](Result<Snapshot> map) { answer.set_value(map ? *std::move(map) : nullptr); });
    return answer.get_future().get();
  }
  void Draw(SessionId session, slam::ChunkKey key, std::int16_t log_odds) {
    site_->Change({.session = session, .chunks = {{key, UniformChunk(log_odds)}}});
  }
};

TEST_F(SiteQuestions, TheLayerOfDisagreementIsMadeWhenItIsAskedFor) {
  Draw(1, {0, 0}, 300);
  Draw(2, {0, 0}, -300);
  TakeTiles();
  EXPECT_TRUE(site_->snapshot()->disagreement.empty());
  const Snapshot asked = Disagreement();
  const auto tile = asked->disagreement.Find({0, 0, 0});
  ASSERT_NE(tile, nullptr);
  EXPECT_EQ((*DecodeCells(tile->bytes, tile->encoding))[kTileArea / 2 + kTileCells / 2],
            slam::OccupancyOf(300) - slam::OccupancyOf(-300));
  // From then on it is kept up to date.
  Draw(1, {1, 0}, 300);
  Draw(2, {1, 0}, -300);
  TakeTiles();
  EXPECT_NE(site_->snapshot()->disagreement.Find({0, 1, 0}), nullptr);
}

TEST_F(SiteQuestions, TheLayerOfDisagreementIsGoneWhenNobodyHasAskedForAMinute) {
  Draw(1, {0, 0}, 300);
  Draw(2, {0, 0}, -300);
  TakeTiles();
  const Site::Clock::time_point begin{};
  const auto kept_at = [&](std::chrono::seconds after) {
    site_->Publish({}, begin + after);
    Settle();
    return !site_->snapshot()->disagreement.empty();
  };
  const auto ask_at = [&](std::chrono::seconds after) {
    std::promise<void> answered;
    site_->AskDisagreement([&](const Result<Snapshot>&) { answered.set_value(); }, begin + after);
    answered.get_future().wait();
  };
  ask_at(std::chrono::seconds(0));
  EXPECT_TRUE(kept_at(std::chrono::seconds(59)));
  ask_at(std::chrono::seconds(59));
  EXPECT_TRUE(kept_at(std::chrono::seconds(118)));
  EXPECT_FALSE(kept_at(std::chrono::seconds(119)));
  // It is not made again by what is drawn, until somebody asks.
  Draw(1, {1, 0}, 300);
  Draw(2, {1, 0}, -300);
  EXPECT_FALSE(kept_at(std::chrono::seconds(120)));
  ask_at(std::chrono::seconds(121));
  EXPECT_TRUE(kept_at(std::chrono::seconds(122)));
}

TEST_F(SiteQuestions, WhatOneRobotHasDrawnIsAMapOfItsOwnAlsoIfItIsHidden) {
  Draw(1, {0, 0}, 300);
  Draw(2, {3, 0}, 300);
  TakeTiles();
  site_->Hide(2);
  TakeTiles();
  EXPECT_EQ(site_->snapshot()->tiles.Find({0, 3, 0}), nullptr);
  const Snapshot part = PartOf(2, 0);
  ASSERT_NE(part, nullptr);
  EXPECT_EQ(part->tiles.Find({0, 0, 0}), nullptr);
  const auto tile = part->tiles.Find({0, 3, 0});
  ASSERT_NE(tile, nullptr);
  EXPECT_GT((*DecodeCells(tile->bytes, tile->encoding))[0], 90);
  EXPECT_EQ(part->info.tile_count, 1U);
  const Snapshot coarse = PartOf(2, 1);
  EXPECT_NE(coarse->tiles.Find({1, 1, 0}), nullptr);
  EXPECT_EQ(coarse->tiles.Find({0, 3, 0}), nullptr);
  EXPECT_EQ(PartOf(7, 0), nullptr) << "nobody has drawn as this one";
}

TEST_F(SiteQuestions, ItsMemoryCountsWhatIsSharedOnce) {
  Draw(1, {0, 0}, 300);
  TakeTiles();
  const std::uint64_t one = site_->snapshot()->info.memory_bytes;
  EXPECT_GE(one, sizeof(slam::GridChunk) + sizeof(TileCells));
  EXPECT_LT(one, 2 * sizeof(slam::GridChunk) + 5 * sizeof(TileCells));
  MemoryCount memory;
  const auto shared = std::make_shared<int>(1);
  memory.Add(shared, 100);
  memory.Add(shared, 100);
  memory.Add(std::shared_ptr<int>(), 100);
  EXPECT_EQ(memory.bytes(), 100U);
}

}  // namespace
}  // namespace cairn::server
