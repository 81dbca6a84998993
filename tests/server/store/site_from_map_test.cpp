#include "server/store/site_from_map.h"

#include <gtest/gtest.h>

#include "server/store/site_edit.h"
#include "tests/server/store/stored_sites.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

TEST(SiteFromMap, IsASiteWithOneEarlierLayerAlsoAfterItWasSaved) {
  std::map<TileKey, TileCells> cells;
  TileCells& tile = cells[{0, -3, 2}];
  tile.fill(kUnknownCell);
  tile[0] = 0;
  tile[1] = 100;
  tile[2] = 50;
  const auto store = MemoryStore();
  ASSERT_TRUE(AddSiteFromMap(*store, "hall", cells, 0.05));
  const TempDirectory directory;
  ASSERT_TRUE(WriteSiteFile(*store, "hall", directory / "hall.site"));
  const auto into = MemoryStore();
  Put(*into, {});  // Its sessions have numbers up to 3.
  const auto imported = ImportSite(*into, directory / "hall.site");
  ASSERT_TRUE(imported) << imported.error().message;
  EXPECT_EQ(imported->site.name, "hall");
  EXPECT_EQ(imported->site.resolution_m, 0.05);
  EXPECT_TRUE(imported->sessions.empty());
  const auto layers = ReadLayers(*into, HashName("hall"));
  ASSERT_TRUE(layers);
  ASSERT_EQ(layers->size(), 1U);
  EXPECT_GT(layers->front().session, 3U);
  const auto contents = ReadSite(*into, "hall");
  ASSERT_TRUE(contents);
  EXPECT_EQ(contents->site.past, (std::vector<std::uint64_t>{layers->front().session}));
  ASSERT_EQ(layers->front().grid.chunks.size(), 1U);
  const StoredChunk& chunk = layers->front().grid.chunks.front();
  EXPECT_EQ(chunk.x, -3);
  EXPECT_EQ(chunk.y, 2);
  const std::int16_t* const log_odds = chunk.cells.get();
  EXPECT_EQ(log_odds[0], -389);
  EXPECT_EQ(log_odds[1], 389);
  EXPECT_EQ(log_odds[2], 0);
  EXPECT_EQ(log_odds[3], INT16_MIN);
}

TEST(SiteFromMap, TakesNoNameThatIsNone) {
  const auto store = MemoryStore();
  EXPECT_EQ(AddSiteFromMap(*store, "a/b", {}, 0.05).error().code, StatusCode::kInvalidArgument);
  EXPECT_TRUE(Everything(*store).empty());
}

}  // namespace
}  // namespace cairn::server::testing
