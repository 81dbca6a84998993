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

// A client that asks for a part of the map is shown that first, and the rest as the wire brings it.
TEST(TileMirror, AnAnswerFillsWhatHasNotComeYet) {
  TileMirror mirror(kSite);
  EXPECT_TRUE(mirror.Apply(Announce(0, 6, 2)));
  EXPECT_TRUE(mirror.Apply(MirroredTile(1, 0, 5)));
  EXPECT_FALSE(mirror.Fill(0, MirroredTile(1, 0, 4).tile)) << "what has come counts";
  EXPECT_TRUE(mirror.Fill(0, MirroredTile(2, 0, 6).tile));
  EXPECT_EQ(mirror.tiles().size(), 2U);
  EXPECT_EQ(mirror.ChangesSince({}).changed.size(), 2U);
  EXPECT_EQ(mirror.version(), 5U) << "a wire that brings nothing must be noticed";
  EXPECT_FALSE(mirror.complete());
  EXPECT_FALSE(mirror.Apply(MirroredTile(2, 0, 6))) << "it is here already";
  EXPECT_EQ(mirror.version(), 6U);
  EXPECT_TRUE(mirror.complete());
  EXPECT_TRUE(mirror.Apply(MirroredTile(2, 0, 7, true)));
  EXPECT_FALSE(mirror.Fill(0, MirroredTile(2, 0, 6).tile)) << "a removed tile does not come back";
  EXPECT_EQ(mirror.tiles().size(), 1U);
  EXPECT_TRUE(mirror.Apply(MirroredTile(1, 1, 8)));
  EXPECT_FALSE(mirror.Fill(0, MirroredTile(3, 0, 7).tile)) << "of an epoch before";
}

// A mirror that lived through a restart of the server rejected every tile of the new one.
TEST(TileMirror, AHigherGenerationStartsOver) {
  TileMirror mirror(kSite);
  MapInfo info = Announce(4, 100, 1);
  info.generation = 1;
  EXPECT_TRUE(mirror.Apply(std::move(info)));
  TileSample old = MirroredTile(1, 4, 100);
  old.generation = 1;
  EXPECT_TRUE(mirror.Apply(TileSample(old)));
  EXPECT_TRUE(mirror.complete());
  TileSample first = MirroredTile(2, 0, 1);
  first.generation = 2;
  EXPECT_TRUE(mirror.Apply(std::move(first)));
  EXPECT_FALSE(mirror.info());
  EXPECT_FALSE(mirror.complete());
  EXPECT_EQ(mirror.epoch(), 0U);
  EXPECT_EQ(mirror.generation(), 2U);
  ASSERT_EQ(mirror.tiles().size(), 1U);
  EXPECT_EQ(mirror.tiles()[0].key.x, 2);
  old.tile.version = 101;
  EXPECT_FALSE(mirror.Apply(TileSample(old)));
  MapInfo late = Announce(5, 200, 1);
  late.generation = 1;
  EXPECT_FALSE(mirror.Apply(std::move(late)));
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

// Tiles do not arrive in the order of their versions, so a reader that kept the highest version would miss some.
TEST(TileMirror, AReaderIsToldEveryChangeOnce) {
  TileMirror mirror(kSite);
  EXPECT_TRUE(mirror.Apply(MirroredTile(1, 0, 9)));
  TileChanges changes = mirror.ChangesSince({});
  ASSERT_EQ(changes.changed.size(), 1U);
  EXPECT_TRUE(mirror.Apply(MirroredTile(2, 0, 5)));
  changes = mirror.ChangesSince(changes.now);
  EXPECT_FALSE(changes.whole);
  ASSERT_EQ(changes.changed.size(), 1U);
  EXPECT_EQ(changes.changed[0].key.x, 2);
  EXPECT_TRUE(mirror.ChangesSince(changes.now).changed.empty());
  EXPECT_TRUE(mirror.Apply(MirroredTile(2, 0, 10, true)));
  changes = mirror.ChangesSince(changes.now);
  ASSERT_EQ(changes.changed.size(), 1U);
  EXPECT_TRUE(changes.changed[0].removed);
  EXPECT_TRUE(mirror.Apply(MirroredTile(4, 1, 11)));
  changes = mirror.ChangesSince(changes.now);
  EXPECT_TRUE(changes.whole) << "an epoch makes what was before void";
  ASSERT_EQ(changes.changed.size(), 1U);
  EXPECT_EQ(changes.changed[0].key.x, 4);
}

}  // namespace
}  // namespace cairn::client
