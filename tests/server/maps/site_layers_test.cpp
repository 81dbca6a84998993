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
  ASSERT_TRUE(next->Restore(stored->site));
  EXPECT_EQ(CellOf(*next), before);
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

}  // namespace
}  // namespace cairn::server
