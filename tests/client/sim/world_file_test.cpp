#include "client/sim/world_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/sim/ray_caster.h"
#include "client/sim/shipped_worlds.h"
#include "tests/temp_directory.h"

namespace cairn::sim {
namespace {

using ::testing::HasSubstr;

World Parse(const std::string& lists) {
  auto world = ParseWorld("cairn-world: 1\n" + lists, "test");
  EXPECT_TRUE(world) << world.error().message;
  return world ? *world : World{};
}

std::string ComplaintAbout(const std::string& text) {
  const auto world = ParseWorld(text, "test");
  return world ? "" : world.error().message;
}

TEST(WorldFile, ReadsEveryList) {
  const World world = Parse(
      "name: hall # a comment\n"
      "walls: [{from: [0, 0], to: [1, 0]}]\n"
      "lines: [{points: [[0, 0], [1, 0], [1, 1]]}, {points: [[0, 0], [1, 0], [1, 1]], closed: true}]\n"
      "boxes: [{center: [5, 5], size: [2, 1]}]\n"
      "pillars: [{center: [1, 2], radius: 0.3}]\n"
      "walkers: [{radius: 0.2, speed: 0.7, points: [[0, 0], [4, 0]]}]\n"
      "routes: [{name: r, points: [[0, 0], [1, 1], [2, 0]]}]\n");
  EXPECT_EQ(world.name, "hall");
  EXPECT_EQ(world.segments.size(), 4u + 2u + 3u + 4u);
  ASSERT_EQ(world.discs.size(), 1u);
  EXPECT_EQ(world.discs[0].center_map, Eigen::Vector2d(1, 2));
  EXPECT_EQ(world.discs[0].radius_m, 0.3);
  ASSERT_EQ(world.walkers.size(), 1u);
  EXPECT_EQ(world.walkers[0].radius_m, 0.2);
  EXPECT_EQ(world.walkers[0].speed_m_s, 0.7);
  ASSERT_EQ(world.routes.size(), 1u);
  EXPECT_EQ(world.routes[0].name, "r");
  EXPECT_EQ(world.routes[0].waypoints_map.size(), 3u);
}

TEST(WorldFile, AWallIsSolidExceptAtItsGaps) {
  const RayCaster walls(Parse("walls: [{from: [0, 0], to: [10, 0], thickness: 0.2, gaps: [[4, 5]]}]").segments);
  EXPECT_NEAR(walls.Cast({2, 3}, {0, -1}, 10), 2.9, 1e-9);
  EXPECT_NEAR(walls.Cast({2, -3}, {0, 1}, 10), 2.9, 1e-9);
  EXPECT_EQ(walls.Cast({4.5, 3}, {0, -1}, 10), kNothingHit);
  EXPECT_NEAR(walls.Cast({4.5, 0}, {1, 0}, 10), 0.5, 1e-9) << "the door's jamb";
}

TEST(WorldFile, WallsThatShareAnEndCloseTheCorner) {
  const RayCaster walls(Parse("walls:\n  - {from: [0, 0], to: [10, 0], thickness: 0.4}\n"
                              "  - {from: [10, 0], to: [10, 5], thickness: 0.4}\n")
                            .segments);
  EXPECT_NEAR(walls.Cast({12, -0.15}, {-1, 0}, 10), 1.8, 1e-9) << "the outer corner is filled";
}

TEST(WorldFile, ATurnedBoxKeepsItsSize) {
  const RayCaster walls(Parse("boxes: [{center: [0, 0], size: [4, 2], degrees: 90}]").segments);
  EXPECT_NEAR(walls.Cast({-5, 0}, {1, 0}, 10), 4.0, 1e-9);
  EXPECT_NEAR(walls.Cast({0, -5}, {0, 1}, 10), 3.0, 1e-9);
}

TEST(WorldFile, WalkersWalkAroundTheirPathForEver) {
  const World world = Parse(
      "lines: [{points: [[0, 0], [1, 0]]}]\nwalkers: [{radius: 0.2, speed: 0.5, points: [[0, 0], [4, 0], [4, 2]]}]");
  EXPECT_TRUE(WalkerAt(world.walkers[0], 0.0).center_map.isApprox(Eigen::Vector2d(0, 0)));
  EXPECT_TRUE(WalkerAt(world.walkers[0], 10.0).center_map.isApprox(Eigen::Vector2d(4, 1)));
  const double round_s = (4 + 2 + std::sqrt(20.0)) / 0.5;
  EXPECT_TRUE(WalkerAt(world.walkers[0], 3 * round_s + 2).center_map.isApprox(Eigen::Vector2d(1, 0), 1e-9));
}

TEST(WorldFile, DoorsAreClosedAndOpenInTurn) {
  const World world =
      Parse("lines: [{points: [[0, 0], [1, 0]]}]\ndoors: [{from: [2, 0], to: [2, 1], closed: 4, open: 3, begin: 1}]");
  ASSERT_EQ(world.doors.size(), 1u);
  const Door& door = world.doors[0];
  for (const auto& [seconds, closed] : {std::pair{0.0, true}, {2.9, true}, {3.1, false}, {5.9, false}, {6.1, true}})
    EXPECT_EQ(IsClosed(door, seconds), closed) << seconds;
  EXPECT_DOUBLE_EQ(DistanceFrom(door, {0, 0.5}), 2.0);
  EXPECT_DOUBLE_EQ(DistanceFrom(door, {2, 3}), 2.0);
  std::vector<Disc> leaf;
  AppendLeaf(door, &leaf);
  for (std::size_t i = 1; i < leaf.size(); ++i)
    EXPECT_LT((leaf[i].center_map - leaf[i - 1].center_map).norm(), 2 * leaf[i].radius_m) << "no ray passes between";
  EXPECT_EQ(leaf.front().center_map, Eigen::Vector2d(2, 0));
  EXPECT_EQ(leaf.back().center_map, Eigen::Vector2d(2, 1));
}

TEST(WorldFile, ComplaintsNameLineColumnAndReason) {
  const std::pair<std::string, std::string> wrong[] = {
      {"", "cairn-world: 1"},
      {"just words", "test:1:1: a world must begin with `cairn-world: 1`"},
      {"cairn-world 1\nsegment 0 0 1 0\n", "a world must begin with `cairn-world: 1`"},
      {"lines: []\n", "'cairn-world' is missing"},
      {"cairn-world: 2\n", "`cairn-world: 1`"},
      {"cairn-world3: 1\n", "'cairn-world' is missing"},
      {"cairn-world: 1\nname: x\n", "the world is empty"},
      {"cairn-world: 1\nname: [x]\n", "test:2:7: world: name must be a word"},
      {"cairn-world: 1\n\n# x\nblobs: []\n", "'blobs' is not a key"},
      {"cairn-world: 1\npillars:\n  - {center: [1, 2]}\n", "test:3:5: pillar: 'radius' is missing"},
      {"cairn-world: 1\ndoors:\n  - {from: [1, 2], to: [1, 2], closed: 1, open: 1}\n", "a door must be wider than 0"},
      {"cairn-world: 1\ndoors:\n  - {from: [1, 2], to: [1, 3], closed: 1, open: 1, begin: -1}\n", "begin must not"},
      {"cairn-world: 1\npillars:\n  - {center: [1, 2], radius: -3}\n", "test:3:30: pillar: radius must be above 0"},
      {"cairn-world: 1\npillars:\n  - {center: [1, 2], radius: 1, 1: 2}\n", "'1' is not a key"},
      {"cairn-world: 1\npillars:\n  - {center: [1, 2], radius: 1, radius: 2}\n", "'radius' is given twice"},
      {"cairn-world: 1\npillars: 7\n", "test:2:10: pillars must be a list"},
      {"cairn-world: 1\npillars: [7]\n", "pillar must be a map"},
      {"cairn-world: 1\nlines:\n  - points: [[0, .nan], [1, 1]]\n", "test:3:18: a point must be a number from"},
      {"cairn-world: 1\nlines:\n  - points: [[0, 0], [1, 1m]]\n", "a point must be a number from"},
      {"cairn-world: 1\nlines:\n  - points: [[0, 0], [1, 10001]]\n", "a point must be a number from"},
      {"cairn-world: 1\nlines:\n  - points: [[0, 0], [1]]\n", "a point must be a list of 2 numbers"},
      {"cairn-world: 1\nlines:\n  - points: [[0, 0]]\n", "at least 2 points"},
      {"cairn-world: 1\nlines:\n  - {points: [[0, 0], [1, 1]], closed: true}\n", "at least 3 points"},
      {"cairn-world: 1\nlines:\n  - {points: [[0, 0], [1, 1]], closed: maybe}\n", "closed must be true or false"},
      {"cairn-world: 1\nwalls:\n  - {from: [0, 0], to: [0, 0]}\n", "two different ends"},
      {"cairn-world: 1\nwalls:\n  - {from: [0, 0], to: [5, 0], thickness: 0}\n", "thickness must be above 0"},
      {"cairn-world: 1\nwalls:\n  - {from: [0, 0], to: [5, 0], gaps: [[4, 6]]}\n", "gaps must be in order"},
      {"cairn-world: 1\nwalls:\n  - {from: [0, 0], to: [5, 0], gaps: [[3, 4], [1, 2]]}\n", "gaps must be in order"},
      {"cairn-world: 1\nboxes:\n  - {center: [0, 0], size: [1, 0]}\n", "sizes of a box must be above 0"},
      {"cairn-world: 1\nroutes: [{name: r, points: [[1, 1]]}]\n", "at least 2 points"},
      {"cairn-world: 1\nroutes: [{name: r, points: [[1, 1], [1, 1]]}]\n", "two equal points"},
      {"cairn-world: 1\npillars: [{center: [0, 0], radius: 1}]\n---\nname: x\n", "test:3:1: a world file holds one"},
      {"cairn-world: 1\npillars: [{center: [0, 0]\n", "test:3:1: not YAML"},
  };
  for (const auto& [text, reason] : wrong) {
    const std::string complaint = ComplaintAbout(text);
    EXPECT_THAT(complaint, HasSubstr("test")) << text;
    EXPECT_THAT(complaint, HasSubstr(reason)) << text;
  }
}

// A few kilobytes whose aliases stand for billions of points, and a megabyte of brackets.
TEST(WorldFile, AHostileTextEndsInAnErrorAndNotInMemory) {
  std::string points = "cairn-world: 1\npillars: [{center: [0, 0], radius: 1}]\nroutes:\n  - &r {name: r, points: [";
  for (int i = 0; i < 2000; ++i) points += "[" + std::to_string(i) + ",0],";
  points += "[0,1]]}\n";
  for (int i = 0; i < 2000; ++i) points += "  - *r\n";
  EXPECT_THAT(ComplaintAbout(points), HasSubstr("more than 1000000 list elements"));

  std::string walls = "cairn-world: 1\nwalls: [&w {from: [0, 0], to: [1, 0]}";
  for (int i = 0; i < 300'000; ++i) walls += ",*w";
  walls += "]\n";
  EXPECT_THAT(ComplaintAbout(walls), HasSubstr("more than 1000000 segments"));

  EXPECT_THAT(ComplaintAbout(std::string(kMaxWorldBytes + 1, '#')), HasSubstr("longer than 1 MiB"));
  for (const char* piece : {"[", "{a: ", "- ", "&a [*a, "}) {
    std::string deep = "cairn-world: 1\nlines: ";
    for (int i = 0; i < 20'000; ++i) deep += piece;
    EXPECT_NE(ComplaintAbout(deep), "");
  }
  EXPECT_NE(ComplaintAbout("cairn-world: 1\nlines: &a [{points: *a}]\n"), "") << "a list inside itself";
}

TEST(WorldFile, OpensShippedWorldsAndFilesOfEitherKind) {
  for (const std::string& name : ShippedWorldNames()) {
    const auto surroundings = OpenSurroundings(name);
    ASSERT_TRUE(surroundings) << surroundings.error().message;
    EXPECT_EQ(surroundings->name, name);
    EXPECT_FALSE(surroundings->routes.empty());
  }
  const TempDirectory directory;
  const auto flat = OpenSurroundings(
      directory.Write("flat.yaml", "cairn-world: 1\npillars: [{center: [0, 0], radius: 1}]\n").string());
  ASSERT_TRUE(flat) << flat.error().message;
  EXPECT_EQ(flat->name, "flat") << "the file's name, where the world has none";
  EXPECT_EQ(flat->posts.size(), 1u);
  const auto spatial = OpenSurroundings(
      directory.Write("spatial.txt", "cairn-world3: 1\nslabs: [{from: [0, 0], to: [1, 1], height: 0}]\n").string());
  EXPECT_TRUE(spatial) << spatial.error().message;
}

TEST(WorldFile, AMissingFileIsNamed) {
  for (const Status& error : {OpenWorld("/nowhere/at-all.yaml").error(), OpenWorld3("nowhere").error(),
                              OpenSurroundings("nowhere.yaml").error()}) {
    EXPECT_EQ(error.code, StatusCode::kNotFound);
    EXPECT_THAT(error.message, HasSubstr("neither a file nor one of: building"));
  }
}

}  // namespace
}  // namespace cairn::sim
