// A site with sessions that the test plays: what is published, and how a switch of versions becomes visible.
#include "server/maps/site.h"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <map>
#include <stdexcept>
#include <string>
#include <variant>

#include "server/maps/atlas.h"

namespace cairn::server {
namespace {

std::shared_ptr<const slam::GridChunk> UniformChunk(std::int16_t log_odds) {
  auto chunk = std::make_shared<slam::GridChunk>();
  chunk->log_odds.fill(log_odds);
  return chunk;
}

using Corrections = std::vector<std::pair<SessionId, Correction>>;

// A session that keeps its corrections and leaves the answers to the test.
class FakeSession : public GridOwner {
 public:
  FakeSession(SessionId id, Corrections& corrections) : id_(id), corrections_(corrections) {}
  void SetMapEpoch(std::uint32_t epoch) override { epoch_ = epoch; }
  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
  void Adopt(Correction&& correction) override { corrections_.emplace_back(id_, std::move(correction)); }

 private:
  const SessionId id_;
  Corrections& corrections_;
  std::uint32_t epoch_ = 0;
};

class SiteTest : public ::testing::Test {
 protected:
  SiteTest() {
    for (const SessionId id : {SessionId{1}, SessionId{2}}) {
      sessions_[id] = std::make_shared<FakeSession>(id, corrections_);
      site_->Join(100 + id, id, sessions_[id], 0);
    }
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
    std::vector<TileSample> tiles;
    while (auto value = outbound_.lane(Outbound::Lane::kMap).TryPop()) {
      if (auto* tile = std::get_if<TileSample>(&*value)) tiles.push_back(std::move(*tile));
    }
    return tiles;
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

  static constexpr std::size_t kLane = 64;
  asio::thread_pool pool_{1};
  Outbound outbound_{kLane};
  Corrections corrections_;  // Written on the site's strand: read after Settle.
  std::map<SessionId, std::shared_ptr<FakeSession>> sessions_;
  std::shared_ptr<Site> site_ = std::make_shared<Site>("lab", 0.05, MapsOptions{.max_versions = 3}, pool_, outbound_);
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
  EXPECT_EQ(site_->snapshot()->tiles.Find({0, 9, 9})->version, 1U);
}

TEST_F(SiteTest, TilesThatCouldNotBeSentGoOutLater) {
  for (std::size_t i = 0; i < kLane; ++i) ASSERT_TRUE(outbound_.Send(MapInfo{}));
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  EXPECT_TRUE(TakeTiles().empty());
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
  EXPECT_FALSE(*corrections_[0].second.completed);

  corrections_[1].second.done(
      {.session = 2,
       .displaced = {{{{20, 20}, UniformChunk(100)}}, 5},
       .change = {.session = 2, .chunks = {{{20, 20}, nullptr}, {{21, 21}, UniformChunk(50)}}}});
  EXPECT_EQ(*enabled.get(), 2U);
  EXPECT_TRUE(*corrections_[0].second.completed);
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

// Changes that wait are merged, but not with those before the session's answer to a correction.
TEST_F(SiteTest, AChangeStaysBehindTheAnswerBeforeIt) {
  const std::uint32_t version = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  auto enabled = Enable(version);
  ASSERT_EQ(corrections_.size(), 1U);
  std::promise<void> gate;
  site_->Probe([&] { gate.get_future().wait(); });
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  site_->Change({.session = 1, .chunks = {{{5, 5}, UniformChunk(100)}}});
  corrections_[0].second.done({.session = 1,
                               .displaced = {{{{0, 0}, UniformChunk(100)}, {{5, 5}, UniformChunk(100)}}, 5},
                               .change = {.session = 1, .chunks = {{{0, 0}, UniformChunk(-100)}, {{5, 5}, nullptr}}}});
  site_->Change({.session = 1, .chunks = {{{0, 1}, UniformChunk(-50)}}});
  gate.set_value();
  EXPECT_TRUE(enabled.get());
  TakeTiles();
  const TileSet& tiles = site_->snapshot()->tiles;
  EXPECT_NE(tiles.Find({0, 0, 1}), nullptr);
  EXPECT_EQ(tiles.Find({0, 5, 5}), nullptr);
}

TEST_F(SiteTest, ChangesThatWaitAreOnePieceOfWork) {
  std::promise<void> gate;
  site_->Probe([&] { gate.get_future().wait(); });
  for (int i = 0; i < 1000; ++i) {
    site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(i % 2 == 0 ? 100 : -100)}}});
    site_->Publish();
  }
  const std::uint64_t before = site_->pulse().finished;
  gate.set_value();
  TakeTiles();
  TakeTiles();
  EXPECT_LE(site_->pulse().finished - before, 10U);
  const auto tile = site_->snapshot()->tiles.Find({0, 0, 0});
  EXPECT_EQ((*DecodeCells(tile->bytes, tile->encoding))[0], slam::OccupancyOf(-100));
}

TEST_F(SiteTest, SessionsTheServerForgotAreSwitchedWithoutThem) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  TakeTiles();
  sessions_.clear();
  const std::uint32_t version = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  EXPECT_TRUE(Enable(version).get());
  TakeTiles();
  EXPECT_EQ(site_->snapshot()->info.epoch, 1U);
  const auto cells =
      DecodeCells(site_->snapshot()->tiles.Find({0, 0, 0})->bytes, site_->snapshot()->tiles.Find({0, 0, 0})->encoding);
  EXPECT_EQ((*cells)[0], slam::OccupancyOf(-100));
  EXPECT_TRUE(Enable(1).get());
  TakeTiles();
  const auto again =
      DecodeCells(site_->snapshot()->tiles.Find({0, 0, 0})->bytes, site_->snapshot()->tiles.Find({0, 0, 0})->encoding);
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

// The bound is three versions. Jobs end while version 2 is being enabled: it used to be forgotten, and the last answer
// of the switch crashed the process.
TEST_F(SiteTest, NewVersionsDoNotPushOutTheOneThatIsBeingEnabled) {
  const std::uint32_t version = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  auto enabled = Enable(version);
  ASSERT_EQ(corrections_.size(), 1U);
  for (int job = 0; job < 4; ++job) AddVersion({});
  corrections_.clear();  // The session goes without an answer.
  const auto result = enabled.get();
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(site_->snapshot()->info.enabled_version, version);
}

// An exception on a site's strand ended the process and with it every robot's session.
TEST_F(SiteTest, AnExceptionEndsThePieceOfWorkAndNotTheSite) {
  site_->Probe([] { throw std::runtime_error("out of luck"); });
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  EXPECT_EQ(TakeTiles().size(), 4U);
  // Who waits for an answer gets one, and the next switch can begin.
  class Thrower : public GridOwner {
    void Adopt(Correction&&) override { throw std::runtime_error("out of luck"); }
    void SetMapEpoch(std::uint32_t) override {}
  };
  const auto thrower = std::make_shared<Thrower>();
  site_->Join(103, 3, thrower, 0);
  const std::uint32_t bad = AddVersion({{3, {{}, 1}}});
  EXPECT_EQ(Enable(bad).get().error().code, StatusCode::kInternal);
  const std::uint32_t good = AddVersion({});
  EXPECT_EQ(*Enable(good).get(), good);
}

TEST_F(SiteTest, OneSwitchAtATime) {
  const std::uint32_t version = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  auto first = Enable(version);
  EXPECT_EQ(Enable(1).get().error().code, StatusCode::kUnavailable);
  corrections_.clear();
  EXPECT_TRUE(first.get());
}

// A version is made from a snapshot. Whoever opened a session after it, or during the switch, kept the old epoch, and
// poses and tiles of one moment did not belong together.
TEST_F(SiteTest, ASessionWithoutAPartOfTheVersionLearnsTheEpochToo) {
  const std::uint32_t version = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  auto enabled = Enable(version);
  const auto during = std::make_shared<FakeSession>(3, corrections_);
  site_->Join(103, 3, during, 0);
  Settle();
  EXPECT_EQ(sessions_[2]->epoch(), 0U);
  EXPECT_EQ(during->epoch(), 0U);
  corrections_.clear();
  ASSERT_TRUE(enabled.get());
  Settle();
  EXPECT_EQ(site_->snapshot()->info.epoch, 1U);
  EXPECT_EQ(sessions_[2]->epoch(), 1U);
  EXPECT_EQ(during->epoch(), 1U);
  // What was made before the switch and joins after it.
  const auto late = std::make_shared<FakeSession>(4, corrections_);
  site_->Join(104, 4, late, 0);
  Settle();
  EXPECT_EQ(late->epoch(), 1U);
}

// What a session is told then would never be handled, and be destroyed after its pool.
TEST_F(SiteTest, ASiteThatIsClosedTellsNoSessionAnything) {
  const std::uint32_t version = AddVersion({{1, {{}, 1}}});
  auto enabled = Enable(version);
  ASSERT_EQ(corrections_.size(), 1U);
  std::promise<void> closed;
  site_->Close([&] { closed.set_value(); });
  closed.get_future().wait();
  ASSERT_EQ(enabled.wait_for(std::chrono::seconds(10)), std::future_status::ready);
  EXPECT_EQ(enabled.get().error().code, StatusCode::kUnavailable);
  // The answer that was under way comes too late.
  corrections_[0].second.done({.session = 1, .displaced = {}, .change = {.session = 1, .chunks = {}}});
  corrections_.clear();
  auto next = Enable(AddVersion({{1, {{}, 1}}, {2, {{}, 1}}}));
  ASSERT_TRUE(corrections_.empty());
  EXPECT_TRUE(next.get());
  for (const auto& [id, session] : sessions_) EXPECT_EQ(session->epoch(), 0U);
}

TEST_F(SiteTest, EnablingWhatIsEnabledOrMissing) {
  EXPECT_EQ(*Enable(1).get(), 1U);
  EXPECT_EQ(site_->snapshot()->info.epoch, 0U);
  EXPECT_EQ(Enable(77).get().error().code, StatusCode::kNotFound);
}

// A robot has one session at a time; the one before is not counted and not corrected any more.
TEST_F(SiteTest, ARobotsNewSessionTakesThePlaceOfTheOld) {
  Settle();
  site_->Publish();
  Settle();
  const auto next = std::make_shared<FakeSession>(3, corrections_);
  site_->Join(101, 3, next, 0);
  site_->AddVersion({}, [](Result<std::uint32_t>) {});
  Settle();
  EXPECT_EQ(site_->snapshot()->info.robots, 2U);
  const std::uint32_t version = AddVersion({{1, {{}, 1}}, {3, {{}, 1}}});
  const auto enabled = Enable(version);
  ASSERT_EQ(corrections_.size(), 1U);
  EXPECT_EQ(corrections_[0].first, 3U);
  corrections_.clear();
}

TEST(Atlas, RefusesSitesItDoesNotServeAndTooMany) {
  asio::thread_pool pool(1);
  Outbound outbound(64);
  MapsOptions options;
  options.max_sites = 2;
  Atlas closed(options, 0.05, false, pool, outbound);
  EXPECT_EQ(closed.Enter("a").error().code, StatusCode::kNotFound);
  EXPECT_TRUE(closed.Create("a"));
  EXPECT_TRUE(closed.Enter("a"));
  EXPECT_EQ(closed.Create("/bad").error().code, StatusCode::kInvalidArgument);
  EXPECT_TRUE(closed.Create("b"));
  EXPECT_EQ(closed.Create("c").error().code, StatusCode::kResourceExhausted);
  pool.join();
}

// A robot that entered while the records of a deleted site were being removed lost its own records with them.
TEST(Atlas, ADeletedSiteIsMadeAgainOnlyWhenItIsReleased) {
  asio::thread_pool pool(1);
  Outbound outbound(64);
  Atlas atlas(MapsOptions{}, 0.05, true, pool, outbound);
  EXPECT_TRUE(atlas.Enter("lab"));
  atlas.Remove("lab");
  EXPECT_EQ(atlas.Enter("lab").error().code, StatusCode::kUnavailable);
  atlas.Release("lab");
  EXPECT_TRUE(atlas.Enter("lab"));
  pool.join();
}

// Misspelt names used up the sites for good.
TEST(Atlas, ASiteThatHoldsNothingGivesWay) {
  asio::thread_pool pool(1);
  Outbound outbound(64);
  MapsOptions options;
  options.max_sites = 3;
  Atlas atlas(options, 0.05, true, pool, outbound);
  EXPECT_TRUE(atlas.Create("configured"));
  auto drawn = *atlas.Enter("drawn");
  drawn->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  drawn->Publish();
  auto used = *atlas.Enter("used");
  EXPECT_EQ(atlas.Enter("next").error().code, StatusCode::kResourceExhausted);
  used.reset();
  EXPECT_TRUE(atlas.Enter("next"));
  EXPECT_EQ(atlas.Find("used"), nullptr);
  EXPECT_TRUE(atlas.Enter("one.after"));
  pool.join();
  EXPECT_EQ(drawn->snapshot()->info.tile_count, 1U);
  drawn.reset();
  EXPECT_TRUE(atlas.Enter("another"));
  EXPECT_NE(atlas.Find("configured"), nullptr);
  EXPECT_NE(atlas.Find("drawn"), nullptr);
}

// The first site by name filled the lane each time, and the others were never seen.
TEST(Atlas, AnotherSiteIsTheFirstToBePublishedEachTime) {
  asio::thread_pool pool(1);
  Outbound outbound(1);
  Atlas atlas(MapsOptions{}, 0.05, true, pool, outbound);
  std::map<std::string, std::shared_ptr<Site>> sites;
  for (const char* name : {"a", "b", "c"}) sites[name] = *atlas.Enter(name);
  for (const std::string first : {"a", "b", "c", "a"}) {
    // Work waits on all of them, that of the others earlier.
    for (const auto& [name, site] : sites) {
      if (name != first) site->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
    }
    sites.at(first)->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
    atlas.Publish();
    const auto reach = [](const std::shared_ptr<Site>& site) {
      std::promise<void> reached;
      site->Probe([&] { reached.set_value(); });
      reached.get_future().wait();
    };
    reach(sites.at(first));
    for (const auto& [name, site] : sites) reach(site);
    const auto value = outbound.lane(Outbound::Lane::kMap).TryPop();
    ASSERT_TRUE(value);
    const auto* info = std::get_if<MapInfo>(&*value);
    const auto* tile = std::get_if<TileSample>(&*value);
    ASSERT_TRUE(info != nullptr || tile != nullptr);
    EXPECT_EQ(info != nullptr ? info->site_id : tile->site_id, HashName(first));
  }
  pool.join();
}

}  // namespace
}  // namespace cairn::server
