#include <gtest/gtest.h>

#include <cmath>

#include "client/sim/world_file.h"
#include "tests/fuzz/mutation.h"

namespace cairn::sim {
namespace {

constexpr char kFlatWorld[] =
    "cairn-world: 1\nname: hall\nwalls:\n  - {from: [0, 0], to: [9, 0], thickness: 0.2, gaps: [[1, 2], [4, 5.5]]}\n"
    "lines:\n  - {points: [[0, 0], [1, 0], [1, 1]], closed: true}\nboxes: [{center: [5, 5], size: [2, 1], degrees: "
    "9}]\n"
    "pillars: [{center: [1, 2], radius: 0.3}]\nwalkers: [{radius: 0.2, speed: 0.7, points: [[0, 0], [4, 0]]}]\n"
    "routes:\n  - name: r\n    points: [[0, 0], [1, 1], [2, 0]]\n";
constexpr char kWorldInSpace[] =
    "cairn-world3: 1\nname: hall\nslabs: [{from: [0, 0], to: [24, 14], height: 0}]\n"
    "rectangles: [{corners: [[0, 0, 0], [2, 0, 0], [2, 0, 1]]}]\n"
    "walls: [{from: [0, 0], to: [9, 0], top: 2.5, openings: [{from: 1, to: 2, top: 2}]}]\n"
    "boxes: [{center: [1, 4], size: [0.6, 1.6], top: 1.9, degrees: 20}]\n"
    "pillars: [{center: [8, 1], radius: 0.3, top: 4, sides: 16}]\nroutes: [{name: r, points: [[0, 0], [1, 1]]}]\n";

TEST(WorldFuzz, DamagedWorldsAreRefusedOrFinite) {
  std::mt19937_64 random(7);
  int accepted = 0;
  for (int i = 0; i < 4000; ++i) {
    const std::string bad = Mutate(
        i % 2 == 0 ? kFlatWorld : kWorldInSpace, random,
        {"nan", "1e400", "-", "&a ", "*a", "<<: ", "[", "]", "{", "}", "- ", ": ", "\n", "\t", "? ", "|", "---"});
    const auto surroundings = ParseSurroundings(bad, "fuzz");
    if (!surroundings) {
      EXPECT_EQ(surroundings.error().message.rfind("fuzz", 0), 0u) << surroundings.error().message;
      continue;
    }
    ++accepted;
    for (const Route& route : surroundings->routes) {
      EXPECT_GE(route.waypoints_map.size(), 2u);
      for (const Eigen::Vector2d& point : route.waypoints_map) EXPECT_TRUE(point.allFinite());
    }
    const double range_m = surroundings->scene->Cast({3.1, 1.7, 0.4}, {0.6, 0.8, 0.0}, 100.0);
    EXPECT_GE(range_m, 0.0) << "a distance or infinity, and not NaN";
  }
  EXPECT_GT(accepted, 40);
}

}  // namespace
}  // namespace cairn::sim
