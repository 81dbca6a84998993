#include "server/slam/dpslam/ancestry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "server/slam/dpslam/opacity_window.h"

namespace cairn::slam {
namespace {

using FullMap = std::map<int, CellCounts>;  // By cell, in the tiles of one row.

MapChanges Scribble(std::mt19937_64& rng, FullMap& map) {
  std::map<ChangeTileKey, std::map<int, CellChange>> tiles;
  const auto count = static_cast<int>(rng() % 30);
  for (int i = 0; i < count; ++i) {
    const int tile = static_cast<int>(rng() % 3), cell = static_cast<int>(rng() % 200);
    tiles[{0, tile}][cell] = {static_cast<std::uint16_t>(cell), static_cast<std::uint16_t>(1 + rng() % 40),
                              static_cast<std::uint16_t>(rng() % 2)};
  }
  MapChanges changes;
  for (const auto& [key, cells] : tiles) {
    ChangeTile tile;
    tile.key = key;
    for (const auto& [cell, change] : cells) {
      tile.list.push_back(change);
      CellCounts& sum = map[key.x * kChangeTileArea + cell];
      sum = {sum.travel + change.travel, sum.stops + change.stops};
    }
    changes.Append(std::move(tile));
  }
  return changes;
}

FullMap MapOf(const Ancestry& ancestry, Ancestry::Id id) {
  FullMap map;
  std::vector<Ancestry::Id> line;
  ancestry.LineTo(id, line);
  for (const Ancestry::Id ancestor : line)
    for (const auto& tile : ancestry.changes(ancestor).tiles())
      tile->ForEach([&](std::uint16_t cell, std::uint16_t travel, std::uint16_t stops) {
        CellCounts& sum = map[tile->key.x * kChangeTileArea + cell];
        sum = {sum.travel + travel, sum.stops + stops};
      });
  return map;
}

// Every particle that is an ancestor has at least two children, and no node is left over.
void ExpectMinimal(const Ancestry& ancestry) {
  std::map<Ancestry::Id, int> children;
  std::vector<Ancestry::Id> line;
  std::map<Ancestry::Id, Ancestry::Id> edges;
  for (const Ancestry::Id id : ancestry.living()) {
    ancestry.LineTo(id, line);
    for (std::size_t i = 0; i < line.size(); ++i) edges[line[i]] = i > 0 ? line[i - 1] : Ancestry::kNobody;
    ASSERT_EQ(ancestry.children(id), 0);
    ASSERT_LE(line.size(), ancestry.living().size());
  }
  for (const auto& [id, parent] : edges)
    if (parent != Ancestry::kNobody) ++children[parent];
  for (const auto& [id, count] : children) {
    ASSERT_GE(count, 2);
    ASSERT_EQ(count, ancestry.children(id));
  }
  ASSERT_EQ(ancestry.size(), edges.size());
  ASSERT_LE(ancestry.size(), 2 * ancestry.living().size() - 1);
}

struct Resampling {
  int particles;
  int favourites;  // The survivors have about this many parents.
};

class AncestryUnder : public testing::TestWithParam<Resampling> {};

TEST_P(AncestryUnder, RandomResamplingEqualsCopyingMaps) {
  std::mt19937_64 rng(static_cast<std::uint64_t>(GetParam().particles * 100 + GetParam().favourites));
  Ancestry ancestry;
  std::vector<FullMap> oracle(1);
  for (int generation = 0; generation < 60; ++generation) {
    std::vector<std::size_t> parents;
    for (int i = 0; i < GetParam().particles; ++i) {
      const auto pick = rng() % static_cast<std::uint64_t>(GetParam().favourites);
      parents.push_back(pick * 7919 % oracle.size());
    }
    std::sort(parents.begin(), parents.end());
    std::vector<FullMap> next;
    std::vector<Ancestry::Child> children;
    for (const std::size_t parent : parents) {
      next.push_back(oracle[parent]);
      children.push_back({parent, Scribble(rng, next.back())});
    }
    ancestry.NextGeneration(std::move(children));
    oracle = std::move(next);
    ExpectMinimal(ancestry);
    if (HasFatalFailure()) return;
    for (std::size_t i = 0; i < oracle.size(); ++i) ASSERT_EQ(MapOf(ancestry, ancestry.living()[i]), oracle[i]);
    // As the rays use the maps: from one relative to the next, each change is applied and undone exactly.
    if (generation % 10 != 0) continue;
    OpacityWindow window(ancestry, {0, 0, 3, 1}, StopRate(OpacityOptions{}));
    for (std::size_t i = 0; i < oracle.size(); ++i) {
      window.Show(ancestry.living()[i]);
      FullMap seen;
      for (int y = 0; y < window.height(); ++y)
        for (int x = 0; x < window.width(); ++x)
          if (const CellCounts counts = window.counts()[static_cast<std::size_t>(y * window.width() + x)];
              counts != CellCounts{})
            seen[x / kChangeTileSide * kChangeTileArea + y * kChangeTileSide + x % kChangeTileSide] = counts;
      ASSERT_EQ(seen, oracle[i]);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Pressure, AncestryUnder,
                         testing::Values(Resampling{1, 1}, Resampling{2, 2}, Resampling{30, 1}, Resampling{30, 4},
                                         Resampling{30, 30}, Resampling{60, 1000000}));

TEST(Ancestry, NoPressureKeepsOneParticleEach) {
  std::mt19937_64 rng(5);
  Ancestry ancestry;
  FullMap unused;
  std::vector<Ancestry::Child> children;
  for (int i = 0; i < 10; ++i) children.push_back({0, Scribble(rng, unused)});
  ancestry.NextGeneration(std::move(children));
  EXPECT_EQ(ancestry.size(), 11u);
  for (int generation = 0; generation < 50; ++generation) {
    children.clear();
    for (std::size_t i = 0; i < 10; ++i) children.push_back({i, Scribble(rng, unused)});
    ancestry.NextGeneration(std::move(children));
    EXPECT_EQ(ancestry.size(), 11u);
    EXPECT_EQ(ancestry.depth(), 2u);
  }
}

}  // namespace
}  // namespace cairn::slam
