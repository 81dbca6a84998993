#include "tests/studies/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace cairn::studies {
namespace {

constexpr char kBox[] =
    "cairn-world: 1\nname: box\nlines: [{points: [[-4, -3], [6, -3], [6, 5], [-4, 5]], closed: true}]\n"
    "routes: [{name: round, points: [[-1, 0], [2, 0], [2, 2]]}]\n";

TEST(StudyScene, ShowsTheWallsAScanHits) {
  const Scene scene(kBox);
  sim::LaserOptions laser = Sick(0.0);
  // Looking along +x from the origin: all of the wall ahead, the upper and lower walls from x = 0 on.
  const auto walls = scene.VisibleWalls({0, 0, 0}, laser);
  ASSERT_EQ(walls.size(), 3u);
  int hits = 0;
  double ahead = 0.0, aside = 0.0;
  for (const VisibleWall& wall : walls) {
    hits += wall.hits;
    (std::abs(wall.a_robot.x() - wall.b_robot.x()) < 1e-3 ? ahead : aside) += wall.length();
  }
  EXPECT_EQ(hits, laser.beams);
  EXPECT_NEAR(ahead, 8.0, 0.5);
  EXPECT_NEAR(aside, 12.0, 1.0);
  // The result is in the robot's frame, so from another pose the same wall has other coordinates.
  bool seen = false;
  for (const VisibleWall& wall : scene.VisibleWalls({1, 1, kPi / 2}, laser)) {
    seen = seen || (std::abs(wall.a_robot.x() - 4.0) < 1e-3 && std::abs(wall.b_robot.x() - 4.0) < 1e-3);
  }
  EXPECT_TRUE(seen);
}

TEST(StudyScene, PosesKeepTheirDistanceAndRepeat) {
  const Scene scene("building");
  sim::Random random(3), again(3);
  for (int i = 0; i < 200; ++i) {
    const Pose2 pose = scene.DrawPose(random);
    EXPECT_GE(scene.Clearance(pose), 0.35);
    EXPECT_EQ(pose, scene.DrawPose(again));
  }
}

TEST(StudyScene, DiscsStandInOneScanOnly) {
  const Scene scene(kBox);
  sim::Random random(1);
  const sim::Disc disc{{2, 0}, 0.25};
  const std::size_t middle = 90;
  EXPECT_NEAR(scene.Look({}, Sick(0.0), random, {&disc, 1}).ranges_m[middle], 1.75, 1e-4);
  EXPECT_NEAR(scene.Look({}, Sick(0.0), random).ranges_m[middle], 6.0, 1e-4);
}

TEST(StudyScene, AWorldThatIsNoneIsAnError) {
  EXPECT_THROW(Scene("no such world"), std::invalid_argument);
  EXPECT_THROW(Scene("cairn-world: 1\nname: empty\n"), std::invalid_argument);
}

}  // namespace
}  // namespace cairn::studies
