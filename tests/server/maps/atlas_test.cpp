// The sites of a server by name: which are made, kept and replaced, and whose turn it is to publish.
#include "server/maps/atlas.h"

#include <gtest/gtest.h>

#include <future>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "server/store/journal.h"
#include "server/store/sqlite_store.h"

namespace cairn::server {
namespace {

std::shared_ptr<const slam::GridChunk> DrawnChunk() {
  auto chunk = std::make_shared<slam::GridChunk>();
  chunk->log_odds.fill(100);
  return chunk;
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
  Atlas open(options, 0.05, true, pool, outbound);
  EXPECT_TRUE(open.Create("a"));
  EXPECT_TRUE(open.Create("b"));
  EXPECT_EQ(open.Enter("c").error().code, StatusCode::kResourceExhausted);
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

// While sites are restored, none of them has a session yet. One that held nothing else gave way to the next, and lost
// its record.
TEST(Atlas, AllSitesThatAreStoredComeBack) {
  asio::thread_pool pool(1);
  Outbound outbound(64);
  const auto store = *OpenStore(std::string(kInMemory));
  const std::vector<std::string> names = {"hall", "lab", "yard"};
  RecordChanges changes;
  for (const std::string& name : names) {
    StoredSite site;
    site.name = name;
    site.next_version = 2;
    site.enabled_version = 1;
    changes.put.push_back({{RecordKind::kSite, HashName(name), 0}, BytesOf(site)});
  }
  ASSERT_TRUE(store->Commit(changes));
  Journal journal(*store, {});
  MapsOptions options;
  options.max_sites = 2;  // There were more before.
  Atlas atlas(options, 0.05, true, pool, outbound, &journal);
  StartControl control;
  ASSERT_TRUE(atlas.Restore(control));
  EXPECT_EQ(atlas.All().size(), names.size());
  ASSERT_TRUE(atlas.Create("configured"));  // Before the sessions hold their sites.
  EXPECT_EQ(atlas.All().size(), names.size() + 1);
  journal.Start();
  journal.Stop();
  EXPECT_GE(store->Owners(RecordKind::kSite)->size(), names.size());
  pool.join();
}

TEST(Atlas, ASiteOfWhichAPartCannotBeReadDoesNotGiveWay) {
  asio::thread_pool pool(1);
  Outbound outbound(64);
  MapsOptions options;
  options.max_sites = 1;
  Atlas atlas(options, 0.05, true, pool, outbound);
  (*atlas.Enter("lab"))->LosePart();
  EXPECT_EQ(atlas.Enter("hall").error().code, StatusCode::kResourceExhausted);
  EXPECT_EQ(atlas.Reserve("lab").error().code, StatusCode::kAlreadyExists);
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
  drawn->Change({.session = 1, .chunks = {{{0, 0}, DrawnChunk()}}});
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
      if (name != first) site->Change({.session = 1, .chunks = {{{0, 0}, DrawnChunk()}}});
    }
    sites.at(first)->Change({.session = 1, .chunks = {{{0, 0}, DrawnChunk()}}});
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
