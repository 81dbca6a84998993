// What a site keeps of sessions that no longer exist.
#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <set>
#include <vector>

#include "server/maps/site.h"
#include "server/store/site_contents.h"
#include "server/store/sqlite_store.h"
#include "tests/server/maps/uniform_chunk.h"

namespace cairn::server {
namespace {

// A site that has run for years. Its memory and its store follow the area, not the number of runs.
TEST(SiteLayers, TheOldestOfManySessionsThatAreGoneBecomeOnePartOfTheMap) {
  asio::thread_pool pool(1);
  Outbound outbound(64);
  const auto store = *OpenStore(kInMemory);
  Journal journal(*store, StoreOptions{});
  journal.Start();
  const auto site =
      std::make_shared<Site>("years", 0.05, MapsOptions{.max_past_sessions = 3}, pool, outbound, &journal);
  const auto settle = [&] {
    site->Publish();
    std::promise<void> reached;
    site->Probe([&] { reached.set_value(); });
    reached.get_future().wait();
  };
  for (SessionId id = 1; id <= 10; ++id) {
    const int x = static_cast<int>(id);
    site->Join({.session = id, .robot = 100 + id, .owner = {}, .fragment = id % 2 == 0});
    site->Change({.session = id, .chunks = {{{x, 0}, UniformChunk(100)}}});
    site->Leave(id);
  }
  settle();
  const auto tiles = [](const Site& of) {
    std::set<int> xs;
    for (int x = 0; x <= 10; ++x)
      if (of.snapshot()->tiles.Find({0, x, 0}) != nullptr) xs.insert(x);
    return xs;
  };
  const std::set<int> expected = {1, 3, 5, 7, 9};
  EXPECT_EQ(tiles(*site), expected);
  journal.Stop();
  // Shown: 5 (with what 1 and 3 have drawn), 7 and 9; not joined: 6, 8 and 10.
  EXPECT_EQ(*store->Numbers({.kind = RecordKind::kLayer, .owner = HashName("years")}),
            (std::vector<std::uint64_t>{5, 6, 7, 8, 9, 10}));
  Journal next_journal(*store, StoreOptions{});
  const auto next = std::make_shared<Site>("years", 0.05, MapsOptions{}, pool, outbound, &next_journal);
  const auto stored = ReadSite(*store, "years");
  ASSERT_TRUE(stored);
  ASSERT_TRUE(next->Restore(stored->site));
  EXPECT_EQ(tiles(*next), expected);
  pool.join();
}

}  // namespace
}  // namespace cairn::server
