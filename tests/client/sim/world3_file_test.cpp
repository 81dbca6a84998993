#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/sim/rectangle_tree.h"
#include "client/sim/shipped_worlds.h"
#include "client/sim/world_file.h"

namespace cairn::sim {
namespace {

using ::testing::HasSubstr;

World3 MustParse(const std::string& text) {
  auto world = ParseWorld3("cairn-world3: 1\n" + text, "test");
  EXPECT_TRUE(world) << world.error().message;
  return world ? *world : World3{};
}

TEST(World3File, RectanglesAreGivenByTheirCorners) {
  const World3 world = MustParse("name: w\nrectangles:\n  - corners: [[0,0,0],[2,0,0],[2,0,1],[0,0,1]]\n");
  EXPECT_EQ(world.name, "w");
  ASSERT_EQ(world.rectangles.size(), 1u);
  EXPECT_NEAR(CastAtRectangle(world.rectangles[0], {0.1, -1, 0.9}, {0, 1, 0}), 1.0, 1e-12);
  EXPECT_EQ(CastAtRectangle(world.rectangles[0], {-0.1, -1, 0.5}, {0, 1, 0}), kNothingHit);
}

// A wall along x at y = 0 with a door and a window: rays through the holes fly on, others stop 0.1 m before the middle.
TEST(World3File, WallsHaveDoorsWithLintelsAndWindowsWithSills) {
  const World3 world = MustParse(
      "walls:\n  - {from: [0,0], to: [10,0], thickness: 0.2, top: 2.5, openings: [{from: 1, to: 2, top: 2}, "
      "{from: 5, to: 7, bottom: 1, top: 2}]}\n");
  const RectangleTree tree(world.rectangles);
  const auto cast = [&](double x, double z) { return tree.Cast({x, -3, z}, {0, 1, 0}, 20.0); };
  EXPECT_NEAR(cast(0.5, 1.0), 2.9, 1e-12);
  EXPECT_EQ(cast(1.5, 1.0), kNothingHit) << "the door";
  EXPECT_NEAR(cast(1.5, 2.2), 2.9, 1e-12) << "its lintel";
  EXPECT_EQ(cast(6.0, 1.5), kNothingHit) << "the window";
  EXPECT_NEAR(cast(6.0, 0.5), 2.9, 1e-12) << "its sill";
  EXPECT_EQ(cast(3.0, 2.6), kNothingHit) << "above the wall";
  EXPECT_NEAR(cast(10.05, 1.0), 2.9, 1e-12) << "half a thickness beyond the end";
}

TEST(World3File, BoxesSlabsAndPillars) {
  const World3 world = MustParse(
      "slabs: [{from: [-5,-5], to: [5,5], height: 0}]\n"
      "boxes: [{center: [2,0], size: [1,1], top: 1, degrees: 45}]\n"
      "pillars: [{center: [-2,0], radius: 0.5, top: 2, sides: 4}]\n");
  const RectangleTree tree(world.rectangles);
  EXPECT_NEAR(tree.Cast({0, 0, 0.5}, {1, 0, 0}, 9.0), 2.0 - std::sqrt(0.5), 1e-9) << "the box's edge";
  EXPECT_NEAR(tree.Cast({2, 0, 3}, {0, 0, -1}, 9.0), 2.0, 1e-12) << "its top";
  EXPECT_NEAR(tree.Cast({0, 0, 0.5}, {-1, 0, 0}, 9.0), 1.5, 1e-9) << "the pillar's corner";
  EXPECT_NEAR(tree.Cast({4, 4, 3}, {0, 0, -1}, 9.0), 3.0, 1e-12) << "the floor";
}

TEST(World3File, MistakesAreNamedWithTheirLine) {
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"", "empty"},
      {"name: x\n", "empty"},
      {"colour: red\n", "'colour' is not a key"},
      {"slabs: 7\n", "test:2:8: slabs must be a list"},
      {"slabs:\n  - {from: [0,0], to: [0,5], height: 0}\n", "test:3:5: a slab needs an area"},
      {"slabs:\n  - {from: [0,0], to: [1,5]}\n", "'height' is missing"},
      {"slabs:\n  - {from: [0,0,0], to: [1,5], height: 0}\n", "list of 2 numbers"},
      {"slabs:\n  - {from: [0,.nan], to: [1,5], height: 0}\n", "must be a number from"},
      {"slabs:\n  - {from: [0,0], to: [1,20000], height: 0}\n", "must be a number from"},
      {"rectangles:\n  - corners: [[0,0,0],[2,0,0],[3,0,1]]\n", "right angles"},
      {"rectangles:\n  - corners: [[0,0,0],[2,0,0],[2,0,1],[0,0,2]]\n", "does not close"},
      {"rectangles:\n  - corners: [[0,0,0],[2,0,0],[4,0,0]]\n", "area"},
      {"boxes:\n  - {center: [0,0], size: [1,1], bottom: 2, top: 1}\n", "top must be above bottom"},
      {"boxes:\n  - {center: [0,0], size: [1,-1], top: 1}\n", "size"},
      {"walls:\n  - {from: [0,0], to: [0,0]}\n", "two different ends"},
      {"walls:\n  - {from: [0,0], to: [4,0], openings: [{from: 3, to: 5, top: 2}]}\n", "inside the wall"},
      {"walls:\n  - {from: [0,0], to: [4,0], openings: [{from: 2, to: 3, top: 2}, {from: 1, to: 1.5, top: 2}]}\n",
       "in order"},
      {"walls:\n  - {from: [0,0], to: [4,0], from: [1,1]}\n", "twice"},
      {"pillars:\n  - {center: [0,0], radius: 1, sides: 2.5}\n", "sides"},
      {"routes:\n  - {name: r, points: [[0,0]]}\n", "at least 2 points"},
      {"routes:\n  - {name: r, points: [[0,0],[0,0]]}\n", "two equal points"},
      {"slabs: [{from: [0,0\n", "test:"},
  };
  for (const auto& [text, message] : wrong) {
    const auto world = ParseWorld3("cairn-world3: 1\n" + text, "test");
    ASSERT_FALSE(world) << text;
    EXPECT_THAT(world.error().message, HasSubstr(message)) << text;
    EXPECT_THAT(world.error().message, HasSubstr("test:"));
  }
  EXPECT_FALSE(ParseWorld3("", "test"));
  EXPECT_FALSE(ParseWorld3("just words", "test"));
  EXPECT_FALSE(ParseWorld3("cairn-world3: 2\nslabs: [{from: [0,0], to: [1,1], height: 0}]\n", "test"));
  EXPECT_FALSE(OpenWorld3("no/such/file.yaml"));
}

TEST(World3File, ShippedWorldsOpenByName) {
  const auto world = OpenWorld3("hall3d");
  ASSERT_TRUE(world) << world.error().message;
  EXPECT_EQ(world->name, "hall3d");
  EXPECT_FALSE(world->routes.empty());
  EXPECT_FALSE(OpenWorld3("room")) << "a flat world";
}

}  // namespace
}  // namespace cairn::sim
