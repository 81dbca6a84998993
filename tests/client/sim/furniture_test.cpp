#include "client/sim/furniture.h"

#include <gtest/gtest.h>

#include <variant>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"

namespace cairn::sim {
namespace {

TEST(Furniture, StandsInTheSamePlacesWithTheSameSeedAndElsewhereWithAnother) {
  const Surroundings office = *OpenSurroundings("office");
  const auto one = FurnitureIn(office, {.pieces = 30, .seed = 1}),
             same = FurnitureIn(office, {.pieces = 30, .seed = 1});
  const auto other = FurnitureIn(office, {.pieces = 30, .seed = 2});
  ASSERT_EQ(one.size(), 30U);
  ASSERT_EQ(other.size(), 30U);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].disc.center_map, same[i].disc.center_map);
    EXPECT_EQ(one[i].disc.radius_m, same[i].disc.radius_m);
    moved += one[i].disc.center_map != other[i].disc.center_map ? 1U : 0U;
  }
  EXPECT_EQ(moved, one.size());
}

TEST(Furniture, IsInNobodysWay) {
  for (const char* const world : {"office", "building", "storey", "hall3d"}) {
    const Surroundings place = *OpenSurroundings(world);
    for (const Post& piece : FurnitureIn(place, {.pieces = 50, .seed = 3})) {
      for (const Route& route : place.routes) {
        const double length_m = ClosedLength(route.waypoints_map);
        for (double way_m = 0.0; way_m < length_m; way_m += 0.1) {
          const double apart = (PlaceOnPath(route.waypoints_map, way_m).p_map - piece.disc.center_map).norm();
          ASSERT_GT(apart - piece.disc.radius_m, 0.6) << world;
        }
      }
    }
  }
}

// A room of one square metre has no room for any.
TEST(Furniture, APlaceWithoutRoomStaysEmpty) {
  World world;
  world.name = "cell";
  world.segments = {{{0, 0}, {1, 0}}, {{1, 0}, {1, 1}}, {{1, 1}, {0, 1}}, {{0, 1}, {0, 0}}};
  world.routes = {{"round", {{0.4, 0.5}, {0.6, 0.5}}}};
  EXPECT_TRUE(FurnitureIn(SurroundingsOf(world), {.pieces = 10, .seed = 1}).empty());
}

TEST(Furniture, AppearsInTheScansOfAFleet) {
  FleetOptions options;
  options.robots = 1;
  Fleet bare = *Fleet::Create(*OpenSurroundings("office"), options);
  options.furniture = {.pieces = 60, .seed = 1};
  Fleet furnished = *Fleet::Create(*OpenSurroundings("office"), options);
  bool nearer = false;
  for (int i = 0; i < 600; ++i) {
    const FleetRecord a = bare.Next(), b = furnished.Next();
    const auto* const one = std::get_if<Scan>(&a.record);
    const auto* const other = std::get_if<Scan>(&b.record);
    if (one == nullptr || other == nullptr) continue;
    for (std::size_t k = 0; k < one->ranges_m.size(); ++k) nearer |= other->ranges_m[k] < one->ranges_m[k] - 0.5F;
  }
  EXPECT_TRUE(nearer);
  options.furniture.pieces = 1001;
  EXPECT_FALSE(Fleet::Create(*OpenSurroundings("office"), options));
}

}  // namespace
}  // namespace cairn::sim
