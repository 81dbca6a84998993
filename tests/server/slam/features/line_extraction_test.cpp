#include "server/slam/features/line_extraction.h"

#include <gtest/gtest.h>

#include <limits>

#include "server/slam/features/line_fit.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using test::FullTurnLaser;
using test::Laser;
using test::Look;
using test::Room;
using test::World;

std::vector<LineFeature> LinesOf(const Scan& scan) {
  return ExtractLines(PointsOf(scan), scan, LineOptions{});
}

TEST(LineFit, RecoversALineFromItsPoints) {
  for (const double alpha : {-3.0, -kPi / 2, -0.4, 0.0, 0.7, kPi / 2, 2.5}) {
    const Eigen::Vector2d normal(std::cos(alpha), std::sin(alpha)), along(-normal.y(), normal.x());
    PointSums sums;
    for (int i = -3; i <= 5; ++i) sums.Add(2.0 * normal + 0.3 * i * along);
    const FittedLine line = FitLine(sums);
    EXPECT_NEAR(std::abs(line.normal.dot(normal)), 1.0, 1e-12);
    EXPECT_NEAR(std::abs(line.offset), 2.0, 1e-9);
    EXPECT_NEAR(line.deviation, 0.0, 1e-6);
  }
}

TEST(LineFit, MinimisesDistancesAcrossTheLineNotAlongAnAxis) {
  PointSums sums;  // Two rows of points 0.1 to either side of x = 1: along y this has no slope at all.
  for (int i = 0; i < 5; ++i) sums.Add({0.9, 0.5 * i}), sums.Add({1.1, 0.5 * i});
  const FittedLine line = FitLine(sums);
  EXPECT_NEAR(std::abs(line.normal.x()), 1.0, 1e-12);
  EXPECT_NEAR(line.deviation, 0.1, 1e-9);
}

TEST(LineExtraction, FindsAPerfectRoomExactly) {
  const Scan scan = Look(Room(-2, -3, 5, 7), {0.3, -0.2, 0.3}, FullTurnLaser());
  const std::vector<LineFeature> lines = LinesOf(scan);
  ASSERT_EQ(lines.size(), 4U);
  const Pose2 T_robot_world = Pose2{0.3, -0.2, 0.3}.Inverse();
  // Walls as lines x cos a + y sin a = r of the robot frame; each must be found once, with all its length but
  // the part between the last beam and the corner.
  const std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> walls = Room(-2, -3, 5, 7).walls;
  for (const auto& [a, b] : walls) {
    int found = 0;
    for (const LineFeature& line : lines) {
      const Eigen::Vector2d pa = T_robot_world * a, pb = T_robot_world * b;
      if (std::abs(line.OffsetOf(pa)) > 1e-4 || std::abs(line.OffsetOf(pb)) > 1e-4) continue;
      ++found;
      EXPECT_NEAR(line.length, (b - a).norm(), 0.25);
      EXPECT_LT(line.deviation, 1e-4);
      const Eigen::Vector2d normal(std::cos(line.normal_angle), std::sin(line.normal_angle));
      EXPECT_NEAR(normal.dot(pa), line.distance, 1e-4);
      EXPECT_NEAR(normal.dot(pb), line.distance, 1e-4);
      EXPECT_GE(line.distance, 0.0);
    }
    EXPECT_EQ(found, 1);
  }
}

TEST(LineExtraction, SplitsAtACorner) {
  World world;
  world.Add({{3, -2}, {3, 1}, {0.5, 1}});
  const std::vector<LineFeature> lines = LinesOf(Look(world, {}, Laser{}));
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_NEAR(lines[0].slope, kPi / 2, 1e-4);
  EXPECT_NEAR(lines[1].slope, kPi, 1e-4);
  EXPECT_NEAR((lines[0].last - Eigen::Vector2d(3, 1)).norm(), 0.0, 0.08);
  EXPECT_NEAR((lines[1].first - Eigen::Vector2d(3, 1)).norm(), 0.0, 0.2);
}

TEST(LineExtraction, ASymmetricCornerSplitsAtItsCorner) {
  World world;  // The least-squares line of both walls has their ends as far away as the corner.
  world.Add({{2, -1}, {3, 0}, {2, 1}});
  const std::vector<LineFeature> lines = LinesOf(Look(world, {}, Laser{}));
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_NEAR(lines[0].point_count, lines[1].point_count, 1);
}

TEST(LineExtraction, AWallGoesOnBehindAPost) {
  World world;
  world.Add({{4, -3}, {4, 3}});
  world.Add({{2, -0.05}, {2, 0.1}});
  const std::vector<LineFeature> lines = LinesOf(Look(world, {}, Laser{}));
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NEAR(lines[0].length, 6.0, 0.2);
}

TEST(LineExtraction, AWallEndsAtAnOpening) {
  World world;
  world.Add({{4, -3}, {4, -0.5}}).Add({{4, 0.5}, {4, 3}}).Add({{7, -6}, {7, 6}});
  const std::vector<LineFeature> lines = LinesOf(Look(world, {}, Laser{}));
  int near_parts = 0;
  for (const LineFeature& line : lines) {
    if (std::abs(line.distance - 4.0) > 0.01) continue;
    ++near_parts;
    EXPECT_NEAR(line.length, 2.5, 0.2);
  }
  EXPECT_EQ(near_parts, 2);
}

TEST(LineExtraction, AWallAcrossTheSeamOfAFullTurnIsOneLine) {
  const std::vector<LineFeature> lines = LinesOf(Look(Room(-2, -3, 5, 6), {}, FullTurnLaser()));
  ASSERT_EQ(lines.size(), 4U);
  const LineFeature& across = lines.back();  // Behind the robot, where beam 0 looks.
  EXPECT_GT(across.first_beam, across.last_beam);
  EXPECT_NEAR(across.distance, 2.0, 1e-4);
  EXPECT_NEAR(across.length, 6.0, 0.3);
}

TEST(LineExtraction, TheStartOfAFullTurnDoesNotMatter) {
  const World world = test::Office();
  const std::vector<LineFeature> reference = LinesOf(Look(world, {}, FullTurnLaser()));
  for (const int shift : {17, 90, 200, 301}) {
    Laser laser = FullTurnLaser();
    laser.first_rad += shift * laser.step_rad;
    const std::vector<LineFeature> lines = LinesOf(Look(world, {}, laser));
    ASSERT_EQ(lines.size(), reference.size()) << shift;
    for (const LineFeature& line : lines) {
      const bool found = std::any_of(reference.begin(), reference.end(), [&](const LineFeature& other) {
        return (line.first - other.first).norm() < 0.02 && (line.last - other.last).norm() < 0.02;
      });
      EXPECT_TRUE(found) << shift;
    }
  }
}

TEST(LineExtraction, AClockwiseScannerSeesTheSameLinesInTheSameOrder) {
  const World world = test::Office();
  Laser clockwise;
  clockwise.first_rad = kPi / 2;
  clockwise.step_rad = -Radians(1.0);
  const std::vector<LineFeature> a = LinesOf(Look(world, {}, Laser{})), b = LinesOf(Look(world, {}, clockwise));
  ASSERT_EQ(a.size(), b.size());
  ASSERT_GT(a.size(), 3U);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_NEAR((a[i].first - b[i].first).norm(), 0.0, 1e-5);
    EXPECT_NEAR((a[i].last - b[i].last).norm(), 0.0, 1e-5);
    EXPECT_EQ(a[i].ends, b[i].ends);
    EXPECT_EQ(a[i].first_beam, 180 - b[i].first_beam);
  }
}

TEST(LineExtraction, ResolutionAndFieldOfViewDoNotChangeWhatARoomIs) {
  const World world = Room(-2, -3, 5, 7);
  for (const auto& [beams, field] : std::vector<std::pair<int, double>>{
           {180, 180.0}, {361, 180.0}, {541, 270.0}, {1081, 270.0}, {91, 90.0}, {360, 360.0}, {720, 360.0}}) {
    Laser laser{.beams = beams, .first_rad = -Radians(field / 2)};
    laser.step_rad = field == 360.0 ? 2.0 * kPi / beams : Radians(field) / (beams - 1);
    const std::vector<LineFeature> lines = LinesOf(Look(world, {0.4, 0.3, 0.2}, laser));
    const std::size_t walls = field == 90.0 ? 2U : field == 180.0 ? 3U : 4U;
    EXPECT_GE(lines.size(), walls - (field == 90.0 ? 1U : 0U)) << beams;
    EXPECT_LE(lines.size(), walls + (field == 270.0 ? 1U : 0U)) << beams;
  }
}

TEST(LineExtraction, AStubBetweenParallelWallsIsTurnedPerpendicular) {
  World world;  // The jog between the two walls is 0.35 m wide: its few noisy points alone could not tell its slope.
  world.Add({{3.2, -3}, {3.2, 0.4}, {3.55, 0.4}, {3.55, 3}});
  std::mt19937_64 engine(5);
  Laser laser{.beams = 721, .step_rad = Radians(0.25)};
  laser.sigma_m = 0.01;
  int seen = 0;
  for (int run = 0; run < 20; ++run) {
    const std::vector<LineFeature> lines = LinesOf(Look(world, {0, 1.5, 0}, laser, &engine));
    for (const LineFeature& line : lines) {
      if (line.length > 1.0 || line.point_count > LineOptions{}.correct_below_points) continue;
      ++seen;
      const double off = std::abs(LineAngleDiff(line.slope, 0.0));
      EXPECT_LT(off, Radians(2.0));
    }
  }
  EXPECT_GT(seen, 0);
}

TEST(LineExtraction, ScansWithoutStructureHaveNoLines) {
  Scan scan = Look(World{}, {}, Laser{});  // The world is empty.
  EXPECT_TRUE(LinesOf(scan).empty());
  scan.ranges_m.clear();
  EXPECT_TRUE(LinesOf(scan).empty());
  scan.ranges_m = {2.0F};
  EXPECT_TRUE(LinesOf(scan).empty());
  scan.ranges_m.assign(181, std::numeric_limits<float>::quiet_NaN());
  EXPECT_TRUE(LinesOf(scan).empty());
}

// Every second beam to the wall ahead returns from a little behind it.
TEST(LineExtraction, AWallMayDeviateFromItsLineAsMuchAsTheOptionSays) {
  Scan scan = Look(World{}, {}, Laser{});
  const auto set_roughness = [&](double rough_m) {
    for (int beam = 80; beam <= 100; ++beam) {
      const double x = 8.0 + (beam % 2 == 0 ? rough_m : -rough_m);
      scan.ranges_m[static_cast<std::size_t>(beam)] = static_cast<float>(x / std::cos(Radians(beam - 90.0)));
    }
  };
  set_roughness(0.035);
  ASSERT_EQ(LinesOf(scan).size(), 1U);
  EXPECT_NEAR(LinesOf(scan).front().deviation, 0.035, 0.002);
  set_roughness(0.045);
  EXPECT_TRUE(LinesOf(scan).empty());
}

// Ranges without any structure: sometimes a few neighbouring hits lie on a line by chance.
TEST(LineExtraction, APureChanceScanShowsOneLineOrTwoAndTheyAreOfFewPoints) {
  std::mt19937_64 engine(1);
  std::uniform_real_distribution<float> anywhere(1.0F, 8.0F);
  constexpr int kScans = 400;
  int found = 0, points = 0, most_points = 0;
  for (int run = 0; run < kScans; ++run) {
    Scan scan = Look(World{}, {}, Laser{});
    for (float& range : scan.ranges_m) range = anywhere(engine);
    for (const LineFeature& line : LinesOf(scan)) {
      ++found;
      points += line.point_count;
      most_points = std::max(most_points, line.point_count);
    }
  }
  // The right number is 0. The actual number is checked from both sides, within three standard deviations of
  // such a count.
  EXPECT_NEAR(static_cast<double>(found) / kScans, 1.72, 0.2);
  EXPECT_LT(points, 4.5 * found);
  EXPECT_LE(most_points, 10);
}

TEST(LineExtraction, AFullTurnOfEightThousandEqualRangesEnds) {
  Laser laser = FullTurnLaser(8192);
  Scan scan = Look(World{}, {}, laser);
  // A circle: the lines are its chords, none of them is wrong, and the time is bounded.
  scan.ranges_m.assign(8192, 3.0F);
  for (const LineFeature& line : LinesOf(scan)) EXPECT_LT(line.deviation, 0.04);
}

TEST(LineExtraction, EveryLineIsWithinTheScanAndFinite) {
  std::mt19937_64 engine(3);
  std::uniform_real_distribution<float> range(-1.0F, 40.0F);
  for (int run = 0; run < 200; ++run) {
    Laser laser = run % 2 == 0 ? FullTurnLaser(90) : Laser{.beams = 100};
    Scan scan = Look(World{}, {}, laser);
    float held = 3.0F;
    for (float& r : scan.ranges_m) {
      if (engine() % 6 == 0) held = range(engine);
      r = held;
    }
    const int beams = static_cast<int>(scan.ranges_m.size());
    for (const LineFeature& line : LinesOf(scan)) {
      EXPECT_TRUE(line.first.allFinite() && line.last.allFinite());
      EXPECT_TRUE(line.first_beam >= 0 && line.first_beam < beams && line.last_beam >= 0 && line.last_beam < beams);
      EXPECT_GE(line.point_count, 4);
      EXPECT_LE(line.point_count, beams);
      EXPECT_NEAR(line.length, (line.last - line.first).norm(), 1e-9);
    }
  }
}

}  // namespace
}  // namespace cairn::slam
