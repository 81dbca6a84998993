// A site with sessions that the test plays: what is published, and how a switch of versions becomes visible.
#include "server/maps/site.h"

#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <stdexcept>
#include <string>

#include "tests/server/maps/site_sessions.h"

namespace cairn::server {
namespace {

using namespace testing;

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

// A robot that did not say where it starts draws in a frame of its own.
TEST_F(SiteTest, AFragmentIsShownFromTheVersionThatJoinsItUntilOneThatDoesNot) {
  auto fragment = std::make_shared<FakeSession>(3, corrections_);
  site_->Join({.session = 3, .robot = 103, .owner = fragment, .fragment = true});
  site_->Change({.session = 3, .chunks = {{{7, 7}, UniformChunk(100)}}});
  EXPECT_TRUE(TakeTiles().empty());

  const std::uint32_t version = AddVersion({{3, {{{{8, 8}, UniformChunk(100)}}, 3}}});
  auto enabled = Enable(version);
  ASSERT_EQ(corrections_.size(), 1U);
  EXPECT_FALSE(corrections_[0].second.grid.fragment);
  corrections_[0].second.done(
      {.session = 3,
       .displaced = {.chunks = {{{7, 7}, UniformChunk(100)}}, .keyframes = 3, .path = {}, .fragment = true},
       .change = {.session = 3, .chunks = {{{7, 7}, nullptr}, {{8, 8}, UniformChunk(100)}}}});
  EXPECT_TRUE(enabled.get());
  TakeTiles();
  EXPECT_NE(site_->snapshot()->tiles.Find({0, 8, 8}), nullptr);
  EXPECT_EQ(site_->snapshot()->tiles.Find({0, 7, 7}), nullptr);

  corrections_.clear();
  auto back = Enable(1);
  ASSERT_EQ(corrections_.size(), 1U);
  EXPECT_TRUE(corrections_[0].second.grid.fragment);
  corrections_.clear();  // It ends without an answer.
  EXPECT_TRUE(back.get());
  TakeTiles();
  EXPECT_EQ(site_->snapshot()->tiles.Find({0, 7, 7}), nullptr);
  EXPECT_EQ(site_->snapshot()->tiles.Find({0, 8, 8}), nullptr);

  // Of a session that is gone, the site itself knows whether it was shown.
  fragment.reset();
  EXPECT_TRUE(Enable(version).get());
  TakeTiles();
  EXPECT_NE(site_->snapshot()->tiles.Find({0, 8, 8}), nullptr);
  EXPECT_TRUE(Enable(1).get());
  TakeTiles();
  EXPECT_EQ(site_->snapshot()->tiles.Find({0, 7, 7}), nullptr);
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
  EXPECT_LE(site_->pulse().finished - before, 20U);  // Few pieces, and the few tiles that they encode.
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

// Its journal had no room for the correction, so an earlier server's session comes back in the map before the switch.
TEST_F(SiteTest, ASessionThatComesBackFromAnEarlierEpochGetsItsPartOfTheEnabledVersion) {
  const std::uint32_t version = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  auto enabled = Enable(version);
  ASSERT_EQ(corrections_.size(), 1U);
  corrections_[0].second.done({.session = 1,
                               .displaced = {{{{5, 5}, UniformChunk(100)}}, 5},
                               .change = {.session = 1, .chunks = {{{0, 0}, UniformChunk(-100)}}}});
  EXPECT_EQ(*enabled.get(), version);
  corrections_.clear();
  const auto back = std::make_shared<FakeSession>(1, corrections_);
  site_->Change({.session = 1, .chunks = {{{0, 0}, nullptr}, {{5, 5}, UniformChunk(100)}}});
  site_->Join({.session = 1, .robot = 101, .owner = back, .epoch = 0});
  TakeTiles();
  ASSERT_EQ(corrections_.size(), 1U);
  const Correction& correction = corrections_[0].second;
  EXPECT_EQ(correction.epoch, 1U);
  EXPECT_EQ(correction.grid.keyframes, 3U);
  EXPECT_TRUE(correction.grid.chunks.contains({0, 0}));
  correction.done({.session = 1,
                   .displaced = {},
                   .change = {.session = 1, .chunks = {{{5, 5}, nullptr}, {{0, 0}, UniformChunk(-100)}}}});
  TakeTiles();
  EXPECT_NE(site_->snapshot()->tiles.Find({0, 0, 0}), nullptr);
  EXPECT_EQ(site_->snapshot()->tiles.Find({0, 5, 5}), nullptr);
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
  site_->Join({.session = 3, .robot = 103, .owner = thrower});
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
  site_->Join({.session = 3, .robot = 103, .owner = during});
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
  site_->Join({.session = 4, .robot = 104, .owner = late});
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

// What a person has chosen stays until a person asks for something else.
TEST_F(SiteTest, NoAlignmentReplacesTheVersionThatAPersonHasChosen) {
  sessions_.clear();
  const auto enable_by = [this](std::uint32_t version, Site::EnabledBy by) {
    std::promise<Result<std::uint32_t>> enabled;
    site_->Enable(
        version, [&enabled](Result<std::uint32_t> result) { enabled.set_value(std::move(result)); }, {}, by);
    return enabled.get_future().get();
  };
  const auto says_so = [this](std::uint32_t version) {
    const auto versions = site_->snapshot()->info.versions;
    const auto found = std::ranges::find(versions, version, &MapVersionInfo::version);
    return found != versions.end() && found->note.find("chosen by a person") != std::string::npos;
  };
  EXPECT_TRUE(site_->MayBeAligned());
  const std::uint32_t first = AddVersion({{1, {{{{0, 0}, UniformChunk(100)}}, 3}}});
  EXPECT_FALSE(site_->MayBeAligned()) << "a person has not decided about it";
  EXPECT_TRUE(enable_by(first, Site::EnabledBy::kJob));
  EXPECT_TRUE(site_->MayBeAligned());
  const std::uint32_t second = AddVersion({{1, {{{{0, 0}, UniformChunk(-100)}}, 3}}});
  EXPECT_TRUE(enable_by(second, Site::EnabledBy::kAlignment));
  EXPECT_TRUE(enable_by(first, Site::EnabledBy::kPerson));
  EXPECT_FALSE(site_->MayBeAligned());
  EXPECT_EQ(enable_by(second, Site::EnabledBy::kAlignment).error().code, StatusCode::kFailedPrecondition);
  EXPECT_EQ(site_->snapshot()->info.enabled_version, first);
  EXPECT_TRUE(says_so(first));
  EXPECT_FALSE(says_so(second));
  EXPECT_TRUE(enable_by(second, Site::EnabledBy::kJob));
  EXPECT_TRUE(site_->MayBeAligned());
  EXPECT_FALSE(says_so(first) || says_so(second));
  EXPECT_TRUE(enable_by(second, Site::EnabledBy::kPerson)) << "it is enabled already";
  EXPECT_TRUE(says_so(second));
}

// A robot that a person has taken out of the map stays out until a person wants it in again.
TEST_F(SiteTest, AFragmentThatAPersonHasTakenOutIsJoinedOnlyWherePeopleAsk) {
  const auto enable_by = [this](std::uint32_t version, Site::EnabledBy by, bool apart) {
    corrections_.clear();
    std::promise<Result<std::uint32_t>> enabled;
    site_->Enable(
        version, [&enabled](Result<std::uint32_t> result) { enabled.set_value(std::move(result)); }, {}, by);
    Settle();
    for (auto& [session, correction] : corrections_) {
      correction.done(
          {.session = session, .displaced = {}, .change = {.session = session, .chunks = {}}, .fragment = apart});
    }
    return enabled.get_future().get();
  };
  const auto fragment = std::make_shared<FakeSession>(3, corrections_);
  site_->Join({.session = 3, .robot = 103, .owner = fragment, .fragment = true});
  const std::uint32_t apart = AddVersion({{3, {.chunks = {}, .keyframes = 3, .path = {}, .fragment = true}}});
  const std::uint32_t joined = AddVersion({{3, {.chunks = {{{8, 8}, UniformChunk(100)}}, .keyframes = 3}}});
  ASSERT_TRUE(enable_by(apart, Site::EnabledBy::kPerson, true));
  EXPECT_TRUE(site_->kept_apart().empty()) << "it was a fragment before, too";
  ASSERT_TRUE(enable_by(joined, Site::EnabledBy::kJoin, false));
  EXPECT_FALSE(site_->MayBeAligned()) << "a robot that is joined changes nothing of what a person has chosen";
  ASSERT_TRUE(enable_by(apart, Site::EnabledBy::kPerson, true));
  EXPECT_EQ(site_->kept_apart(), std::set<SessionId>{3});
  EXPECT_EQ(enable_by(joined, Site::EnabledBy::kJoin, false).error().code, StatusCode::kFailedPrecondition);
  EXPECT_EQ(site_->snapshot()->info.enabled_version, apart);
  ASSERT_TRUE(enable_by(joined, Site::EnabledBy::kJob, false));
  EXPECT_TRUE(site_->kept_apart().empty());
}

// At the end of a server. The last changes were lost where Publish had been asked for before them and still waited.
TEST_F(SiteTest, WhatChangedLastIsPublishedWhenItCloses) {
  std::promise<void> gate;
  site_->Probe([&] { gate.get_future().wait(); });
  site_->Publish();
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(100)}}});
  std::promise<void> closed;
  site_->Close([&] { closed.set_value(); });
  gate.set_value();
  closed.get_future().wait();
  bool published = false;
  while (auto value = outbound_.lane(Outbound::Lane::kMap).TryPop())
    published = published || std::holds_alternative<TileSample>(*value);
  EXPECT_TRUE(published);
}

// A robot has one session at a time. While the one before is there, it is corrected too.
TEST_F(SiteTest, ARobotIsCountedOnceWithAllItsSessions) {
  Settle();
  site_->Publish();
  Settle();
  const auto next = std::make_shared<FakeSession>(3, corrections_);
  site_->Join({.session = 3, .robot = 101, .owner = next});
  site_->AddVersion({}, [](Result<std::uint32_t>) {});
  Settle();
  EXPECT_EQ(site_->snapshot()->info.robots, 2U);
  const std::uint32_t version = AddVersion({{1, {{}, 1}}, {3, {{}, 1}}});
  const auto enabled = Enable(version);
  ASSERT_EQ(corrections_.size(), 2U);
  EXPECT_EQ(corrections_[0].first, 1U);
  EXPECT_EQ(corrections_[1].first, 3U);
  corrections_.clear();
}

}  // namespace
}  // namespace cairn::server
