#include <gtest/gtest.h>

#include "server/slam/features/line_extraction.h"
#include "server/slam/features/split_and_merge.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::Laser;
using test::Look;
using test::World;

// The line of the scan nearest to lying on x = `x`.
LineFeature WallAt(const Scan& scan, double x) {
  for (const LineFeature& line : ExtractLines(PointsOf(scan), scan, LineOptions{})) {
    if (std::abs(line.midpoint().x() - x) < 0.05 && std::abs(LineAngleDiff(line.slope, kPi / 2)) < 0.05) return line;
  }
  ADD_FAILURE() << "no wall at x = " << x;
  return {};
}

// Figure 3.11, line 1: its right end is the end of the scan, and its left end is hidden by a nearer object.
TEST(LineEnds, OpenWhereTheScanEndsAndWhereSomethingNearerHides) {
  World world;
  world.Add({{0.0, -2.0}, {12.0, -2.0}});  // The wall extends beyond the field of view on the right.
  world.Add({{2.5, -0.6}, {2.5, 0.6}});    // A nearer object hides its left part.
  const Scan scan = Look(world, {0.5, 0, 0}, Laser{});
  for (const LineFeature& line : ExtractLines(PointsOf(scan), scan, LineOptions{})) {
    if (std::abs(line.distance - 2.0) < 0.01 && line.length > 1.0) {
      EXPECT_EQ(line.ends, EndClass::kOpen);
      return;
    }
  }
  FAIL() << "the wall was not found";
}

// Figure 3.11, line 2: nearer points beyond the right end, and on the left nearer points that start right at
// the end.
TEST(LineEnds, LeftEndedWhereAWallTurnsTowardsTheLaser) {
  World world;
  world.Add({{4, -2}, {4, 1}, {3, 1}});  // Concave corner on the left.
  world.Add({{2, -1.5}, {2, -0.5}});     // A board hides the right end.
  EXPECT_EQ(WallAt(Look(world, {}, Laser{}), 4.0).ends, EndClass::kLeftEnded);
}

// Figure 3.11, line 3: what lies beyond the right end is farther away, on the left a wall starts right at the
// end.
TEST(LineEnds, BothEndedBetweenAnOpeningAndACorner) {
  World world;
  world.Add({{3, -1}, {3, 1}, {2.2, 1}});
  world.Add({{6, -6}, {6, -1}});
  EXPECT_EQ(WallAt(Look(world, {}, Laser{}), 3.0).ends, EndClass::kBothEnded);
}

TEST(LineEnds, RightEndedIsTheMirrorImageOfLeftEnded) {
  World world;
  world.Add({{4, 2}, {4, -1}, {3, -1}});
  world.Add({{2, 1.5}, {2, 0.5}});
  EXPECT_EQ(WallAt(Look(world, {}, Laser{}), 4.0).ends, EndClass::kRightEnded);
}

TEST(LineEnds, ABoardInFreeSpaceIsBothEnded) {
  World world;
  world.Add({{3, -0.7}, {3, 0.9}});
  EXPECT_EQ(WallAt(Look(world, {}, Laser{}), 3.0).ends, EndClass::kBothEnded);
}

TEST(LineEnds, AWallThatFadesOutOfRangeIsOpenThere) {
  World world;
  world.Add({{3, -0.5}, {3, 40}});
  Laser laser;
  laser.range_max_m = 5.0;  // Meets the wall at y = 4.
  EXPECT_EQ(WallAt(Look(world, {}, laser), 3.0).ends, EndClass::kRightEnded);
}

TEST(LineEnds, ABoxBeforeARecedingWallDoesNotEndIt) {
  World world;  // Seen from the origin the box starts farther away than the wall's last visible point.
  world.Add({{1, -1}, {9, -1}});
  world.Add({{3.0, -0.55}, {3.0, 0.3}});
  const Scan scan = Look(world, {}, Laser{});
  for (const LineFeature& line : ExtractLines(PointsOf(scan), scan, LineOptions{})) {
    if (std::abs(line.distance - 1.0) < 0.01) {
      EXPECT_EQ(line.ends == EndClass::kLeftEnded || line.ends == EndClass::kBothEnded, false);
    }
  }
}

TEST(LineEnds, InvalidBeamsBeyondAnEndLeaveItOpen) {
  World world;
  world.Add({{3, -0.7}, {3, 0.9}});
  Scan scan = Look(world, {}, Laser{});
  for (float& range : scan.ranges_m) {
    if (std::isinf(range)) range = 0.0F;  // Some scanners return a wrong value when the beam hits nothing.
  }
  EXPECT_EQ(WallAt(scan, 3.0).ends, EndClass::kOpen);
}

}  // namespace
}  // namespace cairn::slam
