// A site with sessions that the test plays: what is published, and how a switch of versions becomes visible.
#include "server/maps/site.h"

#include <gtest/gtest.h>

#include <future>

#include "server/maps/atlas.h"

namespace cairn::server {
namespace {

std::shared_ptr<const slam::GridChunk> UniformChunk(std::int16_t log_odds) {
  auto chunk = std::make_shared<slam::GridChunk>();
  chunk->log_odds.fill(log_odds);
  return chunk;
}

class SiteTest : public ::testing::Test {
 protected:
  SiteTest() : pool_(1) {
    SitePorts ports;
    ports.send = [this](OutboundValue value) {
      const MutexLock lock(mutex_);
      if (full_) return false;
      if (auto* tile = std::get_if<TileSample>(&value)) tiles_.push_back(std::move(*tile));
      return true;
    };
    ports.correct = [this](const std::string&, SessionId session, Correction&& correction) {
      if (gone_) return false;
      corrections_.emplace_back(session, std::move(correction));
      return true;
    };
    site_ = std::make_shared<Site>("lab", 0.05, MapsOptions{}, pool_, std::move(ports));
  }
  ~SiteTest() override { pool_.join(); }

  void Settle() {
    std::promise<void> reached;
    site_->Probe([&] { reached.set_value(); });
    reached.get_future().wait();
  }
  std::vector<TileSample> TakeTiles() {
    site_->Publish();
    Settle();
    const MutexLock lock(mutex_);
    return std::exchange(tiles_, {});
  }
  std::future<Result<std::uint32_t>> Enable(std::uint32_t version) {
    const auto promise = std::make_shared<std::promise<Result<std::uint32_t>>>();
    site_->Enable(version, [promise](Result<std::uint32_t> result) { promise->set_value(std::move(result)); });
    Settle();
    return promise->get_future();
  }
  std::uint32_t AddVersion(std::map<SessionId, RobotGrid> parts) {
    std::promise<std::uint32_t> number;
    MapVersion version;
    version.parts = std::move(parts);
    site_->AddVersion(std::move(version), [&](Result<std::uint32_t> result) { number.set_value(*result); });
    return number.get_future().get();
  }

  asio::thread_pool pool_;
  Mutex mutex_;
  bool full_ = false;
  bool gone_ = false;
  std::vector<TileSample> tiles_;
  std::vector<std::pair<SessionId, Correction>> corrections_;
  std::shared_ptr<Site> site_;
};

TEST_F(SiteTest, PublishesOnlyWhatChanged) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}, {{9, 9}, UniformChunk(100)}}});
  EXPECT_EQ(TakeTiles().size(), 8U);  // Two on each of four levels.
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(120)}}});
  const auto changed = TakeTiles();
  EXPECT_EQ(changed.size(), 4U);
  for (const TileSample& tile : changed) EXPECT_EQ(tile.tile.version, 2U);
  EXPECT_TRUE(TakeTiles().empty());
  EXPECT_EQ(site_->snapshot()->info.version, 2U);
  EXPECT_EQ(site_->snapshot()->tiles.at({0, 9, 9})->version, 1U);
}

TEST_F(SiteTest, TilesThatCouldNotBeSentGoOutLater) {
  full_ = true;
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  EXPECT_TRUE(TakeTiles().empty());
  {
    const MutexLock lock(mutex_);
    full_ = false;
  }
  EXPECT_EQ(TakeTiles().size(), 4U);
}

TEST_F(SiteTest, ASwitchIsSeenAllAtOnceWithTombstones) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  site_->Change({.session = 2, .chunks = {{{20, 20}, UniformChunk(100)}}});
  TakeTiles();
  const std::uint32_t version =
      AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}, {2, {{{{21, 21}, UniformChunk(50)}}, 3}}});
  EXPECT_EQ(version, 2U);
  EXPECT_EQ(site_->snapshot()->info.versions.size(), 2U);
  auto enabled = Enable(version);
  ASSERT_EQ(corrections_.size(), 2U);
  EXPECT_EQ(corrections_[0].second.epoch, 1U);

  // The first session has adopted and maps on; the second has not: nothing of it is to be seen yet.
  corrections_[0].second.done({.session = 1,
                               .displaced = {{{{0, 0}, UniformChunk(100)}}, 5},
                               .change = {.session = 1, .chunks = {{{0, 0}, UniformChunk(-100)}}}});
  site_->Change({.session = 1, .chunks = {{{0, 1}, UniformChunk(-50)}}});
  EXPECT_TRUE(TakeTiles().empty());
  EXPECT_EQ(site_->snapshot()->info.epoch, 0U);

  corrections_[1].second.done(
      {.session = 2,
       .displaced = {{{{20, 20}, UniformChunk(100)}}, 5},
       .change = {.session = 2, .chunks = {{{20, 20}, nullptr}, {{21, 21}, UniformChunk(50)}}}});
  EXPECT_EQ(*enabled.get(), 2U);
  std::map<TileKey, TileSample> samples;
  for (const TileSample& tile : TakeTiles()) samples[tile.tile.key] = tile;
  EXPECT_TRUE(samples.at({0, 20, 20}).deleted);
  EXPECT_FALSE(samples.at({0, 21, 21}).deleted);
  EXPECT_TRUE(samples.contains({0, 0, 1}));
  for (const auto& [key, tile] : samples) EXPECT_EQ(tile.tile.epoch, 1U);
  EXPECT_EQ(site_->snapshot()->info.enabled_version, 2U);

  // And back: the sessions get what they gave up.
  corrections_.clear();
  auto back = Enable(1);
  ASSERT_EQ(corrections_.size(), 2U);
  EXPECT_EQ(corrections_[0].second.grid.keyframes, 5U);
  EXPECT_TRUE(corrections_[1].second.grid.chunks.contains({20, 20}));
}

TEST_F(SiteTest, SessionsTheServerForgotAreSwitchedWithoutThem) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  TakeTiles();
  gone_ = true;
  const std::uint32_t version = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  EXPECT_TRUE(Enable(version).get());
  TakeTiles();
  EXPECT_EQ(site_->snapshot()->info.epoch, 1U);
  const auto cells =
      DecodeCells(site_->snapshot()->tiles.at({0, 0, 0})->bytes, site_->snapshot()->tiles.at({0, 0, 0})->encoding);
  EXPECT_EQ((*cells)[0], slam::OccupancyOf(-100));
  EXPECT_TRUE(Enable(1).get());
  TakeTiles();
  const auto again =
      DecodeCells(site_->snapshot()->tiles.at({0, 0, 0})->bytes, site_->snapshot()->tiles.at({0, 0, 0})->encoding);
  EXPECT_EQ((*again)[0], slam::OccupancyOf(100));
}

// A session may go between the correction and its answer; the switch must not hang for ever.
TEST_F(SiteTest, ASessionThatGoesWithoutAnsweringDoesNotHoldUpTheSwitch) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  TakeTiles();
  const std::uint32_t version = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  auto enabled = Enable(version);
  ASSERT_EQ(corrections_.size(), 1U);
  corrections_.clear();
  EXPECT_TRUE(enabled.get());
}

TEST_F(SiteTest, OneSwitchAtATime) {
  const std::uint32_t version = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  auto first = Enable(version);
  EXPECT_EQ(Enable(1).get().error().code, StatusCode::kUnavailable);
  corrections_.clear();
  EXPECT_TRUE(first.get());
}

TEST_F(SiteTest, EnablingWhatIsEnabledOrMissing) {
  EXPECT_EQ(*Enable(1).get(), 1U);
  EXPECT_EQ(site_->snapshot()->info.epoch, 0U);
  EXPECT_EQ(Enable(77).get().error().code, StatusCode::kNotFound);
}

TEST(Atlas, RefusesSitesItDoesNotServeAndTooMany) {
  asio::thread_pool pool(1);
  MapsOptions options;
  options.max_sites = 2;
  Atlas closed(options, 0.05, false, pool, {});
  EXPECT_EQ(closed.Enter("a").error().code, StatusCode::kNotFound);
  EXPECT_TRUE(closed.Create("a"));
  EXPECT_TRUE(closed.Enter("a"));
  EXPECT_EQ(closed.Create("/bad").error().code, StatusCode::kInvalidArgument);
  EXPECT_TRUE(closed.Create("b"));
  EXPECT_EQ(closed.Create("c").error().code, StatusCode::kResourceExhausted);
  pool.join();
}

}  // namespace
}  // namespace cairn::server
