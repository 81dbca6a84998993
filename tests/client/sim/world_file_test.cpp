#include "client/sim/world_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/sim/ray_caster.h"
#include "client/sim/shipped_worlds.h"

namespace cairn::sim {
namespace {

using ::testing::HasSubstr;

World Parse(const std::string& statements) {
  auto world = ParseWorld("cairn-world 1\n" + statements, "test");
  EXPECT_TRUE(world) << world.error().message;
  return world ? *world : World{};
}

std::string ComplaintAbout(const std::string& text) {
  const auto world = ParseWorld(text, "test");
  return world ? "" : world.error().message;
}

TEST(WorldFile, ReadsEveryStatement) {
  const World world = Parse(
      "name hall # a comment\n"
      "segment 0 0 1 0\n"
      "polyline 0 0 1 0 1 1\n"
      "polygon 0 0 1 0 1 1\n"
      "rectangle 5 5 2 1\n"
      "disc 1 2 0.3\n"
      "walker 0.2 0.7 0 0 4 0\n"
      "route r 0 0 \\\n 1 1   2 0\n");
  EXPECT_EQ(world.name, "hall");
  EXPECT_EQ(world.segments.size(), 1u + 2u + 3u + 4u);
  ASSERT_EQ(world.discs.size(), 1u);
  EXPECT_EQ(world.discs[0].radius_m, 0.3);
  ASSERT_EQ(world.walkers.size(), 1u);
  EXPECT_EQ(world.walkers[0].speed_m_s, 0.7);
  ASSERT_EQ(world.routes.size(), 1u);
  EXPECT_EQ(world.routes[0].waypoints_map.size(), 3u);
}

TEST(WorldFile, AWallIsSolidExceptAtItsGaps) {
  const RayCaster walls(Parse("thickness 0.2\nwall 0 0 10 0 gap 4 5").segments);
  EXPECT_NEAR(walls.Cast({2, 3}, {0, -1}, 10), 2.9, 1e-9);
  EXPECT_NEAR(walls.Cast({2, -3}, {0, 1}, 10), 2.9, 1e-9);
  EXPECT_EQ(walls.Cast({4.5, 3}, {0, -1}, 10), kNothingHit);
  EXPECT_NEAR(walls.Cast({4.5, 0}, {1, 0}, 10), 0.5, 1e-9) << "the door's jamb";
}

TEST(WorldFile, WallsThatShareAnEndCloseTheCorner) {
  const RayCaster walls(Parse("thickness 0.4\nwall 0 0 10 0\nwall 10 0 10 5").segments);
  EXPECT_NEAR(walls.Cast({12, -0.15}, {-1, 0}, 10), 1.8, 1e-9) << "the outer corner is filled";
}

TEST(WorldFile, ATurnedRectangleKeepsItsSize) {
  const RayCaster walls(Parse("rectangle 0 0 4 2 90").segments);
  EXPECT_NEAR(walls.Cast({-5, 0}, {1, 0}, 10), 4.0, 1e-9);
  EXPECT_NEAR(walls.Cast({0, -5}, {0, 1}, 10), 3.0, 1e-9);
}

TEST(WorldFile, WalkersGoRoundTheirPathForEver) {
  const World world = Parse("segment 0 0 1 0\nwalker 0.2 0.5 0 0 4 0 4 2");
  EXPECT_TRUE(WalkerAt(world.walkers[0], 0.0).center_map.isApprox(Eigen::Vector2d(0, 0)));
  EXPECT_TRUE(WalkerAt(world.walkers[0], 10.0).center_map.isApprox(Eigen::Vector2d(4, 1)));
  const double round_s = (4 + 2 + std::sqrt(20.0)) / 0.5;
  EXPECT_TRUE(WalkerAt(world.walkers[0], 3 * round_s + 2).center_map.isApprox(Eigen::Vector2d(1, 0), 1e-9));
}

TEST(WorldFile, ComplaintsNameLineAndReason) {
  EXPECT_THAT(ComplaintAbout("segment 0 0 1 0\n"), HasSubstr("test:1: the first statement must be `cairn-world 1`"));
  EXPECT_THAT(ComplaintAbout("cairn-world 2\n"), HasSubstr("cairn-world 1"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\n\n# x\nblob 1\n"), HasSubstr("test:4: blob: not a statement"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\ndisc 1 2\n"), HasSubstr("test:2: disc: radius is missing"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\ndisc 1 2 -3\n"), HasSubstr("must be above 0"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\nsegment 0 0 nan 1\n"), HasSubstr("x 'nan' is not a number"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\nsegment 0 0 1 1m\n"), HasSubstr("y '1m' is not a number"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\nsegment 0 0 1\n"), HasSubstr("y is missing"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\ndisc 0 0 1 1\n"), HasSubstr("more words"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\nwall 0 0 5 0 gap 4 6\n"), HasSubstr("gaps must be in order"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\nwall 0 0 5 0 gap 3 4 gap 1 2\n"), HasSubstr("gaps must be in order"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\nroute r 1 1\n"), HasSubstr("at least 2 points"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\nroute r 1 1 1 1\n"), HasSubstr("two equal points"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\ndisc 0 0 \\\n"), HasSubstr("within a joined line"));
  EXPECT_THAT(ComplaintAbout("cairn-world 1\nname x\n"), HasSubstr("the world is empty"));
  EXPECT_THAT(ComplaintAbout(""), HasSubstr("cairn-world 1"));
}

TEST(WorldFile, AMissingFileIsNamed) {
  const auto world = OpenWorld("/nowhere/at-all.world");
  ASSERT_FALSE(world);
  EXPECT_EQ(world.error().code, StatusCode::kNotFound);
  EXPECT_THAT(world.error().message, HasSubstr("building"));
}

}  // namespace
}  // namespace cairn::sim
