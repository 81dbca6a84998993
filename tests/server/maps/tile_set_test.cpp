#include "server/maps/tile_set.h"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <utility>

namespace cairn::server {
namespace {

TileSet::TilePtr TileAt(TileKey key, std::uint64_t version = 1) {
  auto tile = std::make_shared<Tile>();
  tile->key = key;
  tile->version = version;
  return tile;
}

std::set<TileKey> KeysOf(const TileSet& tiles, int level) {
  std::set<TileKey> keys;
  tiles.ForEach(level, [&](const TileSet::TilePtr& tile) { EXPECT_TRUE(keys.insert(tile->key).second); });
  return keys;
}

TEST(TileSet, HoldsWhatAMapHolds) {
  std::mt19937_64 random(5);
  TileSet tiles;
  std::map<TileKey, TileSet::TilePtr> expected;
  for (int round = 0; round < 200; ++round) {
    std::map<TileKey, TileSet::TilePtr> changes;
    for (int i = 0; i < 20; ++i) {
      const auto draw = [&](int low, int high) {
        return low + static_cast<int>(random() % static_cast<unsigned>(high - low));
      };
      const TileKey key{draw(0, 3), draw(-40, 40), draw(-40, 40)};
      changes[key] = draw(0, 3) == 0 ? nullptr : TileAt(key, random());
    }
    tiles = tiles.With(changes);
    for (const auto& [key, tile] : changes) {
      if (tile) expected[key] = tile;
      if (!tile) expected.erase(key);
    }
  }
  for (int level = 0; level < 3; ++level) {
    std::set<TileKey> keys;
    TileBox box{100, 100, -100, -100, 0};
    for (const auto& [key, tile] : expected) {
      EXPECT_EQ(tiles.Find(key), tile);
      if (key.level != level) continue;
      keys.insert(key);
      box = {std::min(box.x_min, key.x), std::min(box.y_min, key.y), std::max(box.x_max, key.x),
             std::max(box.y_max, key.y), box.count + 1};
    }
    EXPECT_EQ(KeysOf(tiles, level), keys);
    const auto found = tiles.BoxOf(level);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->x_min, box.x_min);
    EXPECT_EQ(found->y_min, box.y_min);
    EXPECT_EQ(found->x_max, box.x_max);
    EXPECT_EQ(found->y_max, box.y_max);
    EXPECT_EQ(found->count, box.count);
  }
}

TEST(TileSet, AChangeMakesAnotherSet) {
  const TileKey near{0, 1, 1}, far{0, 500, -500};
  const TileSet before = TileSet().With({{near, TileAt(near)}, {far, TileAt(far)}});
  const TileSet after = before.With({{near, nullptr}});
  EXPECT_NE(before.Find(near), nullptr);
  EXPECT_EQ(after.Find(near), nullptr);
  EXPECT_EQ(after.Find(far), before.Find(far));
  EXPECT_TRUE(after.With({{far, nullptr}}).empty());
  EXPECT_FALSE(after.BoxOf(1));
}

// A change in a large map once copied all of it.
TEST(TileSet, AChangeCopiesOnlyTheBlockThatItIsIn) {
  std::map<TileKey, TileSet::TilePtr> all;
  for (int x = 0; x < 160; x += 8) {
    for (int y = 0; y < 160; y += 8) all[{0, x, y}] = TileAt({0, x, y});
  }
  const TileSet before = TileSet().With(std::exchange(all, {}));
  const TileSet after = before.With({{{0, 1, 1}, TileAt({0, 1, 1})}});
  int copied = 0, shared = 0;
  before.ForEach(0, [&](const TileSet::TilePtr& tile) { ++(tile.use_count() > 1 ? copied : shared); });
  EXPECT_EQ(copied, 4);  // Of 16 x 16 tiles, each eighth.
  EXPECT_EQ(shared, 396);
}

}  // namespace
}  // namespace cairn::server
