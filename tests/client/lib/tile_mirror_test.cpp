#include "client/lib/tile_mirror.h"

#include <gtest/gtest.h>

namespace cairn::client {
namespace {

constexpr NameId kSite = 7;

TileSample MirroredTile(int x, std::uint32_t epoch, std::uint64_t version, bool deleted = false) {
  TileSample sample;
  sample.site_id = kSite;
  sample.tile.key = {0, x, 0};
  sample.tile.epoch = epoch;
  sample.tile.version = version;
  sample.deleted = deleted;
  return sample;
}

MapInfo Announce(std::uint32_t epoch, std::uint64_t version, std::uint32_t tiles) {
  MapInfo info;
  info.site_id = kSite;
  info.epoch = epoch;
  info.version = version;
  info.tile_count = tiles;
  return info;
}

TEST(TileMirror, ANewerVersionReplacesTheTile) {
  TileMirror mirror(kSite);
  EXPECT_TRUE(mirror.Apply(MirroredTile(1, 0, 5)));
  EXPECT_TRUE(mirror.Apply(MirroredTile(1, 0, 6)));
  EXPECT_FALSE(mirror.Apply(MirroredTile(1, 0, 5)));
  EXPECT_FALSE(mirror.Apply(MirroredTile(1, 0, 6)));
  ASSERT_EQ(mirror.tiles().size(), 1U);
  EXPECT_EQ(mirror.tiles()[0].version, 6U);
}

TEST(TileMirror, ATombstoneRemovesTheTileForGood) {
  TileMirror mirror(kSite);
  mirror.Apply(MirroredTile(1, 0, 5));
  EXPECT_TRUE(mirror.Apply(MirroredTile(1, 0, 7, true)));
  EXPECT_TRUE(mirror.tiles().empty());
  EXPECT_FALSE(mirror.Apply(MirroredTile(1, 0, 6)));
  EXPECT_TRUE(mirror.Apply(MirroredTile(1, 0, 8)));
}

TEST(TileMirror, ANewEpochMakesAllOlderTilesVoid) {
  TileMirror mirror(kSite);
  mirror.Apply(MirroredTile(1, 3, 5));
  mirror.Apply(MirroredTile(2, 3, 6));
  EXPECT_TRUE(mirror.Apply(MirroredTile(1, 4, 1)));
  EXPECT_FALSE(mirror.Apply(MirroredTile(2, 3, 99)));
  ASSERT_EQ(mirror.tiles().size(), 1U);
  EXPECT_EQ(mirror.epoch(), 4U);
}

TEST(TileMirror, TheMapTopicAloneAnnouncesAnEpoch) {
  TileMirror mirror(kSite);
  mirror.Apply(MirroredTile(1, 3, 5));
  EXPECT_TRUE(mirror.Apply(Announce(4, 1, 1)));
  EXPECT_TRUE(mirror.tiles().empty());
  EXPECT_FALSE(mirror.Apply(Announce(3, 9, 1)));
}

TEST(TileMirror, IsCompleteWithAllAnnouncedTilesAndVersions) {
  TileMirror mirror(kSite);
  EXPECT_FALSE(mirror.complete());
  mirror.Apply(MirroredTile(1, 0, 5));
  mirror.Apply(Announce(0, 6, 2));
  EXPECT_FALSE(mirror.complete());
  mirror.Apply(MirroredTile(2, 0, 5));
  EXPECT_FALSE(mirror.complete());
  mirror.Apply(MirroredTile(1, 0, 6));
  EXPECT_TRUE(mirror.complete());
}

TEST(TileMirror, OtherSitesDoNotMatter) {
  TileMirror mirror(kSite);
  TileSample other = MirroredTile(1, 9, 5);
  other.site_id = 8;
  EXPECT_FALSE(mirror.Apply(std::move(other)));
  EXPECT_EQ(mirror.epoch(), 0U);
}

TEST(TileMirror, GivesOneLevelOfThePyramid) {
  TileMirror mirror(kSite);
  mirror.Apply(MirroredTile(1, 0, 5));
  TileSample coarse = MirroredTile(1, 0, 5);
  coarse.tile.key.level = 2;
  mirror.Apply(std::move(coarse));
  EXPECT_EQ(mirror.tiles().size(), 2U);
  EXPECT_EQ(mirror.tiles(2).size(), 1U);
}

}  // namespace
}  // namespace cairn::client
