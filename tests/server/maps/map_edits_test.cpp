// What people say about a map, over what robots have drawn.
#include "server/maps/map_edits.h"

#include <gtest/gtest.h>

#include "server/maps/joint_map.h"
#include "server/store/records.h"
#include "tests/server/maps/uniform_chunk.h"

namespace cairn::server {
namespace {

constexpr double kCell_m = 0.05;
constexpr double kTile_m = kTileCells * kCell_m;

MapEdit Box(MapEditKind kind, double x_m, double y_m, double side_m) {
  MapEdit edit;
  edit.kind = kind;
  edit.points_map = {{x_m, y_m}, {x_m + side_m, y_m}, {x_m + side_m, y_m + side_m}, {x_m, y_m + side_m}};
  return edit;
}

std::uint8_t CellAt(const JointMap& map, int x, int y) {
  const TileKey key{0, FloorDiv(x, kTileCells), FloorDiv(y, kTileCells)};
  const auto tile = map.cells().find(key);
  if (tile == map.cells().end()) return kUnknownCell;
  return (*tile->second)[static_cast<std::size_t>((y - key.y * kTileCells) * kTileCells + x - key.x * kTileCells)];
}

TEST(MapEdits, LieOverWhatIsDrawnAndTheLaterOneCounts) {
  MapEdits edits(kCell_m, 8);
  JointMap map(0.8);
  map.Apply({.session = 1, .chunks = {{{-1, -1}, UniformChunk(300)}, {{0, 0}, UniformChunk(300)}}});
  EXPECT_EQ(edits.Add(Box(MapEditKind::kFree, -0.5, -0.5, 1.0)), 1U);
  EXPECT_EQ(edits.Add(Box(MapEditKind::kUnknown, -0.5, -0.5, 0.25)), 2U);
  EXPECT_EQ(edits.Add(Box(MapEditKind::kKeepOut, -0.5, -0.5, 1.0)), 3U);
  map.SetEdits(edits.overlay());
  map.Render();
  EXPECT_EQ(CellAt(map, -1, -1), 0);
  EXPECT_EQ(CellAt(map, 0, 0), 0);
  EXPECT_EQ(CellAt(map, 9, 9), 0);
  EXPECT_GT(CellAt(map, 10, 9), 90) << "beside the edit";
  EXPECT_EQ(CellAt(map, -10, -10), kUnknownCell);
  EXPECT_EQ(CellAt(map, -5, -5), 0);
  // Where nobody has drawn, an edit shows all the same.
  EXPECT_EQ(CellAt(map, -1, 1), 0);
  EXPECT_TRUE(map.cells().contains({1, -1, 0})) << "also in coarser levels";
  // What robots see does not change it.
  map.Apply({.session = 1, .chunks = {{{0, 0}, UniformChunk(400)}}});
  map.Render();
  EXPECT_EQ(CellAt(map, 0, 0), 0);

  ASSERT_TRUE(edits.Remove(1));
  map.SetEdits(edits.overlay());
  map.Render();
  EXPECT_GT(CellAt(map, 0, 0), 90);
  EXPECT_EQ(CellAt(map, -10, -10), kUnknownCell) << "the other one is still there";
  EXPECT_FALSE(map.cells().contains({0, -1, 0})) << "nothing is left there";
}

// The cells are the same as if the map had been made with what is left.
TEST(MapEdits, AfterAnyOrderOfChangesTheMapIsAsIfMadeAnew) {
  MapEdits edits(kCell_m, 8);
  JointMap map(0.8);
  const auto drawn = GridChange{.session = 1, .chunks = {{{0, 0}, UniformChunk(-300)}, {{3, 0}, UniformChunk(100)}}};
  map.Apply(drawn);
  const auto show = [&] {
    map.SetEdits(edits.overlay());
    map.Render();
    JointMap anew(0.8);
    anew.Apply(drawn);
    MapEdits made_anew(kCell_m, 8);
    for (const MapEdit& edit : *edits.all()) ASSERT_TRUE(made_anew.Add(edit));
    anew.SetEdits(made_anew.overlay());
    anew.Render();
    ASSERT_EQ(anew.cells().size(), map.cells().size());
    for (const auto& [key, cells] : anew.cells()) ASSERT_EQ(*cells, *map.cells().at(key));
  };
  for (int i = 0; i < 6; ++i) {
    ASSERT_TRUE(edits.Add(Box(static_cast<MapEditKind>(i % 3), 0.4 * kTile_m * i, 1.0, 5.0)));
    show();
  }
  for (const std::uint64_t id : {3, 1, 6, 2, 5, 4}) {
    ASSERT_TRUE(edits.Remove(id));
    show();
  }
  EXPECT_TRUE(edits.overlay().empty());
}

// A site whose numbers are used up could not be read by the next server. A saved file can hold any number.
TEST(MapEdits, TheLastNumbersAreKeptForRemovals) {
  MapEdits edits(kCell_m, 8);
  const MapEdit box = Box(MapEditKind::kFree, 0, 0, 1);
  edits.Restore({}, kMaxEditsVersion - 3, [] {});
  ASSERT_TRUE(edits.Add(box));
  EXPECT_EQ(edits.Add(box).error().code, StatusCode::kResourceExhausted);
  ASSERT_TRUE(edits.Remove(kMaxEditsVersion - 2));
  EXPECT_LT(edits.version(), kMaxEditsVersion);
  EXPECT_FALSE(edits.Add(box));
}

// Whatever edits say, they take a bounded part of the memory, and one that does not fit changes nothing.
TEST(MapEdits, TheirTilesAreBounded) {
  MapEdits edits(kCell_m, 4096);
  const auto strip = [](int i) { return Box(MapEditKind::kFree, 0.0, 70.0 * i, 70.0); };
  int added = 0;
  Result<std::uint64_t> last = edits.Add(strip(0));
  while (last && added < 1000) last = edits.Add(strip(++added));
  ASSERT_FALSE(last);
  EXPECT_EQ(last.error().code, StatusCode::kResourceExhausted);
  EXPECT_GT(added, 20);
  EXPECT_LE(edits.overlay().size(), kMostOverlayTiles);
  EXPECT_EQ(edits.all()->size(), static_cast<std::size_t>(added));
  const auto tiles = edits.overlay().size();
  EXPECT_TRUE(edits.Add(strip(0))) << "in the same tiles there is room";
  EXPECT_TRUE(edits.Add(Box(MapEditKind::kKeepOut, 5e3, 0.0, 70.0))) << "this gives no cells";
  EXPECT_EQ(edits.overlay().size(), tiles);

  std::vector<MapEdit> all = *edits.all();
  all.push_back(strip(added));
  all.back().id = edits.version() + 1;
  EXPECT_EQ(edits.Restore(all, edits.version() + 1, [] {}), 1U);
  EXPECT_EQ(edits.overlay().size(), tiles);
}

TEST(MapEdits, NumbersAreNotUsedTwiceAndTheNumberOfEditsIsBounded) {
  MapEdits edits(kCell_m, 2);
  const MapEdit box = Box(MapEditKind::kOccupied, 0, 0, 1);
  ASSERT_TRUE(edits.Add(box));
  EXPECT_EQ(edits.Add(box), 2U);
  EXPECT_EQ(edits.Add(box).error().code, StatusCode::kResourceExhausted);
  const auto before = edits.all();
  EXPECT_TRUE(edits.Remove(2));
  EXPECT_EQ(edits.Remove(2).error().code, StatusCode::kNotFound);
  EXPECT_EQ(edits.version(), 3U);
  EXPECT_EQ(before->size(), 2U) << "what others read does not change";
  EXPECT_EQ(edits.Add(box), 4U);
  EXPECT_EQ(edits.Add(MapEdit{}).error().code, StatusCode::kInvalidArgument);
  EXPECT_EQ(edits.version(), 4U);

  MapEdits restored(kCell_m, 2);
  std::size_t advanced = 0;
  EXPECT_EQ(restored.Restore(*edits.all(), edits.version(), [&advanced] { ++advanced; }), 0U);
  EXPECT_EQ(advanced, edits.all()->size());
  EXPECT_EQ(*restored.all(), *edits.all());
  ASSERT_EQ(restored.overlay().size(), edits.overlay().size());
  for (const auto& [key, cells] : edits.overlay()) EXPECT_EQ(*cells, *restored.overlay().at(key));
  EXPECT_TRUE(restored.Remove(4));
  EXPECT_EQ(restored.Add(box), 6U);
}

}  // namespace
}  // namespace cairn::server
