// Panes of glass: what returns a beam, what lets it through, and what is seen in a mirror.
#include <gtest/gtest.h>

#include <cmath>

#include "client/sim/scene.h"
#include "client/sim/shipped_worlds.h"
#include "client/sim/world_file.h"

namespace cairn::sim {
namespace {

// A wall along y = 5 and a pane along y = 2, looked at from y = 0; a wall at x = 40 closes the end of the pane.
constexpr char kWorld[] =
    "cairn-world: 1\n"
    "lines: [{points: [[-100, 5], [100, 5]]}, {points: [[40, -20], [40, 20]]}]\n"
    "glass: [{from: [-30, 2], to: [30, 2]}]\n";

double RangeAt(double degrees_from_normal, const char* world = kWorld, double max_m = 200.0) {
  const auto parsed = ParseWorld(world, "test");
  EXPECT_TRUE(parsed) << parsed.error().message;
  const double angle = Radians(90.0 - degrees_from_normal);
  return SurroundingsOf(*parsed).scene->Cast({0, 0, 0.4}, {std::cos(angle), std::sin(angle), 0.0}, max_m);
}

TEST(Glass, ReturnsBeamsNearItsNormal) {
  EXPECT_NEAR(RangeAt(0.0), 2.0, 1e-9);
  EXPECT_NEAR(RangeAt(9.5), 2.0 / std::cos(Radians(9.5)), 1e-9);
  EXPECT_NEAR(RangeAt(-9.5), 2.0 / std::cos(Radians(9.5)), 1e-9);
}

TEST(Glass, LetsObliqueBeamsThrough) {
  for (const double degrees : {10.5, 45.0, 78.5})
    EXPECT_NEAR(RangeAt(degrees), 5.0 / std::cos(Radians(degrees)), 1e-9) << degrees;
}

// At 80 degrees from the normal the beam meets the pane at x = 11.34 and goes on downwards to the wall at x = 40.
TEST(Glass, MirrorsWhatGrazesIt) {
  EXPECT_NEAR(RangeAt(80.0), 40.0 / std::sin(Radians(80.0)), 1e-9);
  EXPECT_EQ(RangeAt(80.0, kWorld, 40.0), kNothingHit) << "the whole way counts";
}

TEST(Glass, BeamsThatMissItSeeTheWallOnly) {
  EXPECT_NEAR(RangeAt(87.0), 40.0 / std::sin(Radians(87.0)), 1e-9) << "past its end";
}

TEST(Glass, TheNearestThatStopsABeamCounts) {
  constexpr char kTwo[] =
      "cairn-world: 1\n"
      "lines: [{points: [[-100, 5], [100, 5]]}]\n"
      "glass: [{from: [-3, 4], to: [3, 4]}, {from: [-3, 2], to: [3, 2], seen: 0}, {from: [-3, 6], to: [3, 6]}]\n";
  EXPECT_NEAR(RangeAt(5.0, kTwo), 4.0 / std::cos(Radians(5.0)), 1e-9) << "one is never seen, one is behind the wall";
}

TEST(Glass, AngleIsThatInThePlaneForTiltedBeams) {
  const auto world = ParseWorld(kWorld, "test");
  const auto surroundings = SurroundingsOf(*world);
  const Eigen::Vector3d down = Eigen::Vector3d(0.0, 1.0, -0.5).normalized();
  EXPECT_NEAR(surroundings.scene->Cast({0, 0, 5}, down, 50.0), 2.0 * std::sqrt(1.25), 1e-9);
}

TEST(Glass, TheFileIsChecked) {
  const auto complaint = [](const std::string& glass) {
    const auto world = ParseWorld("cairn-world: 1\nlines: [{points: [[0, 0], [1, 0]]}]\nglass: " + glass, "test");
    return world ? std::string() : world.error().message;
  };
  EXPECT_NE(complaint("[{from: [0, 0], to: [0, 0]}]").find("two different ends"), std::string::npos);
  EXPECT_NE(complaint("[{from: [0, 0], to: [1, 0], seen: 91}]").find("0 to 90"), std::string::npos);
  EXPECT_NE(complaint("[{from: [0, 0], to: [1, 0], seen: -1}]").find("0 to 90"), std::string::npos);
  EXPECT_NE(complaint("[{from: [0, 0], to: [1, 0], thick: 1}]").find("'thick' is not a key"), std::string::npos);
}

TEST(Glass, TheShippedWorldHasFrontsAndRoutesThroughTheirDoors) {
  const auto world = OpenWorld("glass");
  ASSERT_TRUE(world) << world.error().message;
  EXPECT_EQ(world->panes.size(), 12u);
  for (const Route& route : world->routes) {
    const auto& points = route.waypoints_map;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d step = points[(i + 1) % points.size()] - points[i];
      for (const Pane& pane : world->panes)
        EXPECT_GT(CastAtSegment({pane.a_map, pane.b_map}, points[i], step.normalized()), step.norm() + 0.3)
            << route.name << ", from point " << i;
    }
  }
}

}  // namespace
}  // namespace cairn::sim
