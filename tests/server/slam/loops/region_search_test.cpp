#include "server/slam/loops/region_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>
#include <vector>

#include "server/slam/loops/unique_pose.h"

namespace cairn::slam {
namespace {

constexpr double kCellM = 0.1;

// Points along the walls of an L-shaped hall without any symmetry.
std::vector<SurfacePoint> Hall() {
  std::vector<SurfacePoint> points;
  const auto wall = [&](Eigen::Vector2d from, const Eigen::Vector2d& to) {
    const Eigen::Vector2d step = (to - from).normalized() * 0.05;
    for (; (to - from).norm() > 0.05; from += step) points.push_back({from, Eigen::Vector2d::UnitX()});
  };
  wall({0, 0}, {8, 0}), wall({8, 0}, {8, 3}), wall({8, 3}, {3, 3}), wall({3, 3}, {3, 7}), wall({3, 7}, {0, 7});
  wall({0, 7}, {0, 0}), wall({5, 1}, {6, 1.5});
  return points;
}

std::vector<Eigen::Vector2d> SeenFrom(const Pose2& T_ref_curr, const std::vector<SurfacePoint>& world) {
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < world.size(); i += 3) points.push_back(T_ref_curr.Inverse() * world[i].p);
  return points;
}

std::vector<SurfacePoint> Corridor() {
  std::vector<SurfacePoint> corridor;
  for (double x = -15; x < 15; x += 0.05)
    for (const double y : {-1.0, 1.0}) corridor.push_back({{x, y}, Eigen::Vector2d::UnitY()});
  return corridor;
}

std::vector<Eigen::Vector2d> PieceOfCorridor() {
  std::vector<Eigen::Vector2d> piece;
  for (double x = -5; x < 5; x += 0.1)
    for (const double y : {-1.0, 1.0}) piece.emplace_back(x, y);
  return piece;
}

TEST(LikelihoodPyramid, EveryLevelBoundsTheFinest) {
  const LikelihoodPyramid pyramid(Hall(), kCellM, 0.3, 5);
  std::mt19937_64 rng(1);
  std::uniform_int_distribution<int> cell(-30, 110);
  for (int run = 0; run < 500; ++run) {
    const int x = cell(rng), y = cell(rng);
    for (int level = 1; level < pyramid.levels(); ++level) {
      int best = 0;
      for (int dy = 0; dy < 1 << level; ++dy)
        for (int dx = 0; dx < 1 << level; ++dx) best = std::max<int>(best, pyramid.Best(0, x + dx, y + dy));
      EXPECT_EQ(pyramid.Best(level, x, y), best) << level << " " << x << " " << y;
    }
  }
}

TEST(LikelihoodPyramid, FallsFromThePointsToNothing) {
  const std::vector<SurfacePoint> one = {{{0.05, 0.05}, Eigen::Vector2d::UnitX()}};
  const LikelihoodPyramid pyramid(one, kCellM, 0.3, 1);
  EXPECT_EQ(pyramid.Best(0, 0, 0), 255);
  EXPECT_EQ(pyramid.Best(0, 1, 0), 170);
  EXPECT_EQ(pyramid.Best(0, 0, -2), 85);
  EXPECT_EQ(pyramid.Best(0, 3, 0), 0);
  EXPECT_EQ(pyramid.Best(0, 10000, -10000), 0);
}

TEST(LikelihoodPyramid, ASumEndsOnlyWhereItCannotBeEnough) {
  using Pyramid = LikelihoodPyramid;
  const Pyramid pyramid(Hall(), kCellM, 0.3, 5);
  std::mt19937_64 rng(2);
  std::uniform_int_distribution<int> cell(-30, 110), move(-100, 100);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  int ended = 0, whole = 0;
  for (int run = 0; run < 2000; ++run) {
    std::vector<Pyramid::Cell> cells(static_cast<std::size_t>(1 + run % 150));
    for (auto& one : cells) one = {cell(rng), cell(rng)};
    const Pyramid::Pattern pattern = pyramid.PatternOf(cells);
    const int level = run % pyramid.levels(), x = run % 2 == 0 ? 0 : move(rng), y = run % 3 == 0 ? 0 : move(rng);
    const auto sums_on = [&](int of_level) {
      Pyramid::SumsFrom sums{};
      for (std::size_t part = 0; part < Pyramid::kParts; ++part)
        for (std::size_t i = part * cells.size() / Pyramid::kParts; i < cells.size(); ++i)
          sums[part] += pyramid.Best(of_level, cells[i].x + x, cells[i].y + y);
      return sums;
    };
    const Pyramid::SumsFrom sums = sums_on(level);
    const auto enough = static_cast<std::int32_t>(share(rng) * 255.0 * static_cast<double>(cells.size()));
    // The bounds of a coarser level are smaller than those that hold everywhere.
    const bool bounded = run % 4 < 2 && level + 1 < pyramid.levels();
    const Pyramid::SumsFrom found =
        pyramid.SumsOfBest(level, pattern, x, y, enough, bounded ? sums_on(level + 1) : Pyramid::MostOf(pattern));
    if (sums.front() > enough) {
      ASSERT_EQ(found, sums) << run;
      ++whole;
    } else {
      ASSERT_LE(found.front(), enough) << run;
      ended += found.front() < sums.front() ? 1 : 0;
    }
  }
  EXPECT_GT(whole, 100);
  EXPECT_GT(ended, 100);
}

TEST(RegionSearch, FindsThePoseAnywhereInTheWindow) {
  const std::vector<SurfacePoint> hall = Hall();
  const LikelihoodPyramid pyramid(hall, kCellM, 0.3, 5);
  for (const Pose2 truth : {Pose2{0, 0, 0}, Pose2{3.5, -2.9, 0.35}, Pose2{-3.7, 3.0, -0.38}, Pose2{1.23, 3.9, 0.2}}) {
    const auto peak = FindBestPose(SeenFrom(truth, hall), pyramid, {{}, 4.0, 0.4}, 0.3);
    ASSERT_TRUE(peak);
    EXPECT_LT((peak->T_ref_curr.translation() - truth.translation()).norm(), 0.15);
    EXPECT_LT(std::abs(AngleDiff(peak->T_ref_curr.theta, truth.theta)), 0.02);
    EXPECT_GT(peak->score, 0.7);
  }
}

// The bounds may skip poses but must not change the result: it equals that of scoring every pose.
TEST(RegionSearch, AgreesWithTryingEveryPose) {
  const std::vector<SurfacePoint> hall = Hall();
  const LikelihoodPyramid pyramid(hall, kCellM, 0.3, 5), flat(hall, kCellM, 0.3, 1);
  std::mt19937_64 rng(7);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int run = 0; run < 5; ++run) {
    const Pose2 truth{any(rng), any(rng), 0.1 * any(rng)};
    const SearchWindow window{{0.1 * any(rng), 0.1 * any(rng), 0.0}, 1.5, 0.15};
    const std::vector<Eigen::Vector2d> points = SeenFrom(truth, hall);
    const auto fast = FindBestPose(points, pyramid, window, 0.1), slow = FindBestPose(points, flat, window, 0.1);
    ASSERT_TRUE(fast && slow);
    EXPECT_DOUBLE_EQ(fast->score, slow->score);
  }
}

// A site may lie anywhere within 1,000 km of the origin of its map.
TEST(RegionSearch, FindsThePoseInAMapThatIsFarFromItsOrigin) {
  std::vector<SurfacePoint> world = Hall();
  const Eigen::Vector2d away(-700e3, 900e3);
  for (SurfacePoint& point : world) point.p += away;
  const Pose2 truth{away.x() + 2.0, away.y() + 1.5, 0.3};
  const std::vector<Eigen::Vector2d> points = SeenFrom(truth, world);
  for (double x = 0.0; x < 160.0; x += 0.05)  // A long wall makes the rasters wide.
    world.push_back({away + Eigen::Vector2d(x, 9.0), Eigen::Vector2d::UnitX()});
  const LikelihoodPyramid pyramid(world, kCellM, 0.3, 5);
  const auto peak = FindBestPose(points, pyramid, {{truth.x + 1.0, truth.y - 0.7, 0.4}, 2.0, 0.3}, 0.3);
  ASSERT_TRUE(peak);
  EXPECT_LT((peak->T_ref_curr.translation() - truth.translation()).norm(), 0.15);
}

TEST(RegionSearch, InPartsItFindsTheSame) {
  const std::vector<SurfacePoint> hall = Hall();
  const LikelihoodPyramid pyramid(hall, kCellM, 0.3, 5);
  const std::vector<Eigen::Vector2d> points = SeenFrom({2.3, -1.9, 0.3}, hall);
  const SearchWindow window{{}, 4.0, 0.4};
  const auto at_once = FindBestPose(points, pyramid, window, 0.3);
  PoseSearch search(points, pyramid, window);
  std::optional<int> parts;
  for (int time = 0; time < 2; ++time) {  // The second time the bounds of the coarsest blocks are known.
    search.Begin(0.3);
    int count = 1;
    for (; !search.GoOn(200); ++count) ASSERT_LT(count, 1000);
    EXPECT_GT(count, 10) << "the blocks of the coarsest level, of which there are 2,340, are looked at in parts, too";
    EXPECT_EQ(parts.value_or(count), count);
    parts = count;
    ASSERT_TRUE(at_once && search.peak());
    EXPECT_EQ(search.peak()->T_ref_curr, at_once->T_ref_curr);
    EXPECT_EQ(search.peak()->score, at_once->score);
  }
}

TEST(RegionSearch, AnyPoseIsFoundSoonerThanTheBest) {
  const LikelihoodPyramid along(Corridor(), kCellM, 0.3, 5);
  PoseSearch search(PieceOfCorridor(), along, {{0.3, 0.2, 0.05}, 4.0, 0.2});
  const auto parts = [&](bool any, double min_score) {
    search.Begin(min_score, {}, any);
    int count = 1;
    while (!search.GoOn(20)) ++count;
    return count;
  };
  const int best = parts(false, 0.3);
  EXPECT_LT(parts(true, 0.3), best);
  ASSERT_TRUE(search.peak());
  EXPECT_GT(search.peak()->score, 0.3);
  parts(true, 0.999);
  EXPECT_FALSE(search.peak());
}

// A pose that is likely saves the search for the best one, and changes nothing if it is wrong.
TEST(UniquePoseSearch, LooksFirstWhereThePoseIsLikely) {
  const std::vector<SurfacePoint> hall = Hall();
  const LikelihoodPyramid pyramid(hall, kCellM, 0.3, 5);
  const Pose2 truth{1.4, -1.1, 0.2};
  std::vector<SurfacePoint> seen;
  for (const Eigen::Vector2d& p : SeenFrom(truth, hall)) seen.push_back({p, Eigen::Vector2d::UnitX()});
  const SearchWindow window{{}, 4.0, 0.4};
  const auto parts = [&](UniquePoseSearch& search) {
    int count = 1;
    while (!search.GoOn(50)) ++count;
    return count;
  };
  UniquePoseSearch plain(seen, pyramid, window, 0.9), right = plain, wrong = plain;
  right.LookFirstIn({{1.5, -1.0, 0.22}, 1.0, 0.3});
  wrong.LookFirstIn({{-2.0, 2.0, -0.2}, 1.0, 0.3});
  const int all = parts(plain);
  EXPECT_LT(parts(right), all);
  EXPECT_GE(parts(wrong), all);
  ASSERT_TRUE(plain.found() && right.found() && wrong.found());
  EXPECT_EQ(*plain.found(), *FindUniquePose(seen, pyramid, window, 0.9));
  EXPECT_EQ(*wrong.found(), *plain.found());
  EXPECT_LT((right.found()->translation() - truth.translation()).norm(), 0.15);
  // A place that is likely is none if others look alike.
  UniquePoseSearch alike(seen, pyramid, window, 0.2);
  alike.LookFirstIn({{1.5, -1.0, 0.22}, 1.0, 0.3});
  parts(alike);
  EXPECT_FALSE(alike.found());
}

TEST(RegionSearch, ACorridorHasARivalAndAHallHasNone) {
  const LikelihoodPyramid along(Corridor(), kCellM, 0.3, 5);
  const std::vector<Eigen::Vector2d> piece = PieceOfCorridor();
  const SearchWindow window{{0.3, 0.2, 0.05}, 4.0, 0.2};
  const auto peak = FindBestPose(piece, along, window, 0.3);
  ASSERT_TRUE(peak);
  EXPECT_TRUE(FindBestPose(piece, along, window, 0.95 * peak->score, Exclusion{peak->T_ref_curr, 1.0, 0.3}));

  const std::vector<SurfacePoint> hall = Hall();
  const LikelihoodPyramid pyramid(hall, kCellM, 0.3, 5);
  const std::vector<Eigen::Vector2d> all = SeenFrom({}, hall);
  const auto best = FindBestPose(all, pyramid, window, 0.3);
  ASSERT_TRUE(best);
  EXPECT_FALSE(FindBestPose(all, pyramid, window, 0.8 * best->score, Exclusion{best->T_ref_curr, 1.0, 0.3}));
}

// A lattice looks promising everywhere at a coarse resolution and fits nowhere, so no region can be skipped.
// The search must report that it gave up.
TEST(RegionSearch, SaysWhenItGaveUp) {
  std::vector<SurfacePoint> lattice;
  for (int x = -60; x <= 60; ++x)
    for (int y = -60; y <= 60; ++y) lattice.push_back({{0.4 * x + 0.05, 0.4 * y + 0.05}, Eigen::Vector2d::UnitX()});
  const LikelihoodPyramid pyramid(lattice, kCellM, 0.1, 5);
  std::mt19937_64 rng(5);
  std::uniform_real_distribution<double> any(-10.0, 10.0);
  std::vector<Eigen::Vector2d> scattered;
  for (int i = 0; i < 30; ++i) scattered.emplace_back(any(rng), any(rng));
  const auto peak = FindBestPose(scattered, pyramid, {{}, 10.0, 0.4}, 0.0);
  ASSERT_TRUE(peak);
  EXPECT_FALSE(peak->complete);
  const auto small = FindBestPose(scattered, pyramid, {{}, 1.0, 0.1}, 0.0);
  ASSERT_TRUE(small);
  EXPECT_TRUE(small->complete);
}

TEST(RegionSearch, NothingIsFoundWhereNothingIs) {
  const LikelihoodPyramid empty({}, kCellM, 0.3, 5);
  EXPECT_FALSE(FindBestPose(std::vector<Eigen::Vector2d>{{1, 1}}, empty, {{}, 2.0, 0.2}, 0.0));
  const LikelihoodPyramid pyramid(Hall(), kCellM, 0.3, 5);
  EXPECT_FALSE(FindBestPose({}, pyramid, {{}, 2.0, 0.2}, 0.0));
  EXPECT_FALSE(FindBestPose(std::vector<Eigen::Vector2d>{{900, 900}}, pyramid, {{}, 2.0, 0.2}, 0.0));
}

}  // namespace
}  // namespace cairn::slam
