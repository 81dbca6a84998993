// What a site shows of sessions that have ended.
#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <vector>

#include "server/maps/site.h"
#include "server/store/site_contents.h"
#include "server/store/sqlite_store.h"
#include "tests/server/maps/uniform_chunk.h"

namespace cairn::server {
namespace {

// A session that drops its corrections once it is gone.
struct Owner : GridOwner {
  bool gone = false;
  void Adopt(Correction&&) override {}
  void SetMapEpoch(std::uint32_t) override {}
};

class SiteLayers : public ::testing::Test {
 protected:
  ~SiteLayers() override { pool_.join(); }
  std::shared_ptr<Site> NewSite(Journal& journal) {
    return std::make_shared<Site>("lab", 0.05, MapsOptions{}, pool_, outbound_, &journal);
  }
  static std::uint8_t CellOf(Site& site) {
    site.Publish();
    std::promise<void> reached;
    site.Probe([&] { reached.set_value(); });
    reached.get_future().wait();
    const auto tile = site.snapshot()->tiles.Find({0, 0, 0});
    return tile == nullptr ? kUnknownCell : (*DecodeCells(tile->bytes, tile->encoding))[0];
  }

  asio::thread_pool pool_{1};
  Outbound outbound_{64};
  std::unique_ptr<Store> store_ = *OpenStore(kInMemory);
};

// A wall that has gone while session 1 drives on; session 2 was there when it still stood.
TEST_F(SiteLayers, WhatEndedFirstIsThePastAlsoForTheNextServer) {
  std::uint8_t before = 0;
  {
    Journal journal(*store_, StoreOptions{});
    journal.Start();
    const auto site = NewSite(journal);
    for (const SessionId id : {SessionId{1}, SessionId{2}}) site->Join({.session = id, .robot = 100 + id, .owner = {}});
    site->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(-389)}}});
    site->Change({.session = 2, .chunks = {{{0, 0}, UniformChunk(389)}}});
    EXPECT_EQ(CellOf(*site), 50);
    site->End(2);
    EXPECT_LT(CellOf(*site), 10);
    site->Leave(2);
    site->Leave(1);
    before = CellOf(*site);
    EXPECT_LT(before, 10);
    journal.Stop();
  }
  Journal journal(*store_, StoreOptions{});
  const auto stored = ReadSite(*store_, "lab");
  ASSERT_TRUE(stored);
  EXPECT_EQ(stored->site.past, (std::vector<std::uint64_t>{2, 1}));
  const auto next = NewSite(journal);
  StartControl control;
  ASSERT_TRUE(next->Restore(stored->site, control));
  EXPECT_GT(control.advanced(), 0U);
  EXPECT_EQ(CellOf(*next), before);
}

TEST_F(SiteLayers, EditsAreThereForTheNextServer) {
  {
    Journal journal(*store_, StoreOptions{});
    journal.Start();
    const auto site = NewSite(journal);
    site->Join({.session = 1, .robot = 101, .owner = {}});
    site->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(389)}}});
    site->Leave(1);
    for (const MapEditKind kind : {MapEditKind::kOccupied, MapEditKind::kFree}) {
      MapEdit edit{.kind = kind, .points_map = {{0, 0}, {1, 0}, {1, 1}, {0, 1}}, .note = "seen by Ann"};
      site->AddEdit(std::move(edit), [](const Result<std::uint64_t>& id) { EXPECT_TRUE(id); });
    }
    site->RemoveEdit(1, [](const Result<std::uint64_t>& version) { EXPECT_EQ(version, 3U); });
    EXPECT_EQ(CellOf(*site), 0);
    journal.Stop();
  }
  Journal journal(*store_, StoreOptions{});
  const auto stored = ReadSite(*store_, "lab");
  ASSERT_TRUE(stored);
  const auto next = NewSite(journal);
  StartControl control;
  ASSERT_TRUE(next->Restore(stored->site, control));
  EXPECT_EQ(CellOf(*next), 0);
  ASSERT_EQ(next->snapshot()->edits->size(), 1U);
  EXPECT_EQ(next->snapshot()->edits->front().id, 2U);
  EXPECT_EQ(next->snapshot()->edits->front().note, "seen by Ann");
  EXPECT_EQ(next->snapshot()->info.edits_version, 3U);
}

// As a session that had ended before the server was started.
TEST_F(SiteLayers, ASessionThatEntersAsEndedIsThePast) {
  Journal journal(*store_, StoreOptions{});
  const auto site = NewSite(journal);
  site->Join({.session = 1, .robot = 101, .owner = {}});
  site->Join({.session = 2, .robot = 102, .owner = {}, .ended = true});
  site->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(-389)}}});
  site->Change({.session = 2, .chunks = {{{0, 0}, UniformChunk(389)}}});
  EXPECT_LT(CellOf(*site), 10);
}

// A robot whose program is started again and again leaves a part of the map each time.
TEST_F(SiteLayers, HoweverManySessionsLeaveTheirLayersAreFew) {
  std::uint8_t before = 0;
  {
    Journal journal(*store_, StoreOptions{});
    journal.Start();
    const auto site = NewSite(journal);
    for (SessionId id = 1; id <= 60; ++id) {
      const bool fragment = id % 3 == 0, draws = id % 3 == 1;
      site->Join({.session = id, .robot = 7, .owner = {}, .fragment = fragment});
      if (fragment || draws) site->Change({.session = id, .chunks = {{{0, 0}, UniformChunk(id == 1 ? 389 : 20)}}});
      if (id == 4) site->AddVersion({.info = {}, .parts = {}, .smoothed = {}}, [](const Result<std::uint32_t>&) {});
      site->End(id);
      site->Leave(id);
    }
    before = CellOf(*site);
    journal.Stop();
  }
  const auto stored = ReadSite(*store_, "lab");
  ASSERT_TRUE(stored);
  EXPECT_EQ(stored->layers.size(), 8U);
  EXPECT_EQ(stored->site.past, stored->layers);
  EXPECT_TRUE(stored->site.fragments.empty());
  Journal journal(*store_, StoreOptions{});
  const auto next = NewSite(journal);
  StartControl control;
  ASSERT_TRUE(next->Restore(stored->site, control));
  EXPECT_EQ(CellOf(*next), before);
}

// Versions know them by the number under which they are merged.
TEST_F(SiteLayers, MergedLayersAreSwitchedWithTheirPartsOfTheVersions) {
  Journal journal(*store_, StoreOptions{});
  journal.Start();
  const auto site = NewSite(journal);
  const auto owner = std::make_shared<Owner>();
  for (const SessionId id : {SessionId{1}, SessionId{2}}) {
    site->Join({.session = id, .robot = id, .owner = owner});
    site->Change({.session = id, .chunks = {{{0, 0}, UniformChunk(50)}}});
  }
  std::promise<std::uint32_t> added;
  MapVersion version;
  version.parts[1].chunks[{0, 0}] = UniformChunk(-389);
  version.parts[2].chunks[{0, 0}] = UniformChunk(-389);
  site->AddVersion(std::move(version), [&](const Result<std::uint32_t>& number) { added.set_value(*number); });
  const std::uint32_t number = added.get_future().get();
  for (SessionId id = 3; id <= 10; ++id) {
    site->Join({.session = id, .robot = id, .owner = owner});
    site->Change({.session = id, .chunks = {{{9, 9}, UniformChunk(10)}}});
  }
  for (SessionId id = 1; id <= 10; ++id) site->Leave(id);
  EXPECT_GT(CellOf(*site), 50);
  owner->gone = true;
  const auto enable = [&](std::uint32_t wanted) {
    std::promise<bool> done;
    site->Enable(wanted, [&](const Result<std::uint32_t>& result) { done.set_value(result.has_value()); });
    return done.get_future().get();
  };
  ASSERT_TRUE(enable(number));
  EXPECT_LT(CellOf(*site), 10);
  ASSERT_TRUE(enable(1));
  EXPECT_GT(CellOf(*site), 50);
  // A job that began before they were merged has a part of one of them alone.
  std::promise<std::uint32_t> late;
  MapVersion of_job;
  of_job.parts[3].chunks[{0, 0}] = UniformChunk(-389);
  site->AddVersion(std::move(of_job), [&](const Result<std::uint32_t>& made) { late.set_value(*made); });
  ASSERT_TRUE(enable(late.get_future().get()));
  EXPECT_GT(CellOf(*site), 50) << "what the others have drawn stays";
}

}  // namespace
}  // namespace cairn::server
