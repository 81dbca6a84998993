#include "server/slam/matching/point_index.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <span>
#include <vector>

namespace cairn::slam {
namespace {

SurfacePoint At(double x, double y) {
  SurfacePoint point;
  point.p = {x, y};
  return point;
}

TEST(PointIndex, FindsWhatLookingAtAllFinds) {
  std::mt19937_64 rng(3);
  std::uniform_real_distribution<double> place(-200.0, 200.0), near(-2.0, 2.0);
  std::vector<SurfacePoint> all;
  for (int i = 0; i < 4000; ++i) all.push_back(i % 8 != 0 ? At(place(rng), place(rng)) : At(near(rng), near(rng)));
  const PointIndex index(all);
  ASSERT_EQ(index.size(), all.size());
  int found = 0, far = 0;
  for (const double max_distance_m : {0.03, 0.12, 0.2, 0.5, 1.0}) {
    for (int i = 0; i < 500; ++i) {
      const Eigen::Vector2d p(near(rng), near(rng));
      const auto nearest = std::min_element(all.begin(), all.end(), [&](const SurfacePoint& a, const SurfacePoint& b) {
        return (a.p - p).squaredNorm() < (b.p - p).squaredNorm();
      });
      const SurfacePoint* answer = index.Nearest(p, max_distance_m);
      const bool near_enough = (nearest->p - p).norm() < max_distance_m;
      (near_enough ? found : far) += 1;
      ASSERT_EQ(answer != nullptr, near_enough);
      if (near_enough) {
        EXPECT_EQ(answer->p, nearest->p);
      }
    }
  }
  EXPECT_GT(found, 500);
  EXPECT_GT(far, 500);
}

// Clouds as dense as walls that were seen forty times, some points twice, and searches that begin at any other point.
TEST(PointIndex, WhereASearchBeginsDoesNotChangeItsAnswer) {
  std::mt19937_64 rng(5);
  std::normal_distribution<double> across(0.0, 0.03);
  std::uniform_real_distribution<double> along(-1.0, 1.0), share(0.0, 1.0);
  std::vector<SurfacePoint> all;
  for (int i = 0; i < 3000; ++i) all.push_back(i % 2 == 0 ? At(along(rng), across(rng)) : At(across(rng), along(rng)));
  for (std::size_t i = 0; i < 300; ++i) all.push_back(all[7 * i]);
  const PointIndex index(all);
  const auto nearest_of_all = [&all](const Eigen::Vector2d& p, double max_distance_m) {
    const SurfacePoint* nearest = nullptr;
    double best = max_distance_m * max_distance_m;
    for (const SurfacePoint& point : all) {
      const double squared = (point.p - p).squaredNorm();
      if (squared < best || (nearest != nullptr && squared == best)) nearest = &point;
      best = std::min(best, squared);
    }
    return nearest == nullptr ? -1 : nearest - all.data();
  };
  PointIndex::Found likely, kept;
  int found = 0;
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector2d p =
        share(rng) < 0.3 ? all[static_cast<std::size_t>(i)].p : Eigen::Vector2d(along(rng), 2.0 * across(rng));
    const double max_distance_m = i % 3 == 0 ? 0.02 : 0.3;
    const auto expected = nearest_of_all(p, max_distance_m);
    PointIndex::Found any;
    for (PointIndex::Found* begin : {&any, &likely, &kept}) {
      const SurfacePoint* answer = index.Nearest(p, max_distance_m, *begin);
      ASSERT_EQ(answer == nullptr, expected < 0) << i;
      if (answer != nullptr) {
        ASSERT_EQ(begin->point, expected) << i;
      }
    }
    found += expected >= 0 ? 1 : 0;
    if (i % 10 == 0) kept = likely;  // From somewhere else.
  }
  EXPECT_GT(found, 1500);
}

// What an alignment does: places that move by less and less.
TEST(PointIndex, APlaceThatMovesALittleHasTheAnswerOfASearch) {
  std::mt19937_64 rng(6);
  std::uniform_real_distribution<double> along(-1.0, 1.0), across(-0.3, 0.3), direction(-1.0, 1.0);
  std::vector<SurfacePoint> all;
  for (int i = 0; i < 600; ++i) all.push_back(At(along(rng), 0.1 * across(rng)));
  const PointIndex index(all);
  int found = 0, none = 0;
  for (int run = 0; run < 3000; ++run) {
    Eigen::Vector2d p(along(rng), across(rng));
    PointIndex::Found last;
    double step_m = 0.02;
    for (int move = 0; move < 12; ++move, step_m *= 0.6) {
      const double max_distance_m = run % 2 == 0 ? 0.15 : std::max(0.1, 0.2 - 0.02 * move);
      const SurfacePoint* answer = index.Nearest(p, max_distance_m, last);
      ASSERT_EQ(answer, index.Nearest(p, max_distance_m)) << run << " " << move;
      (answer != nullptr ? found : none) += 1;
      p += step_m * Eigen::Vector2d(direction(rng), direction(rng));
    }
  }
  EXPECT_GT(found, 3000);
  EXPECT_GT(none, 3000);
}

// Places on the borders of cells, and points that are as near as each other.
TEST(PointIndex, BordersOfCellsHideNothing) {
  PointIndex index;
  EXPECT_EQ(index.Nearest({0.0, 0.0}, 5.0), nullptr);
  for (int i = -20; i <= 20; ++i) index.Add(At(0.1 * i, 0.0));
  for (int i = -20; i <= 20; ++i) {
    for (const double off_m : {-1e-9, 0.0, 1e-9}) {
      const SurfacePoint* answer = index.Nearest({0.1 * i + off_m, 0.3}, 0.31);
      ASSERT_NE(answer, nullptr);
      EXPECT_NEAR(answer->p.x(), 0.1 * i, 1e-12);
    }
  }
}

// A robot that stands still sees the same points again.
TEST(PointIndex, OfEqualPointsTheLastCounts) {
  PointIndex index;
  for (int i = 0; i < 50; ++i) {
    SurfacePoint point = At(1.0, 1.0);
    point.normal = {1.0, 1.0 * i};
    index.Add(point);
  }
  EXPECT_EQ(index.Nearest({1.0, 1.02}, 0.5)->normal.y(), 49.0);
}

// A window that moves over the points: every answer is that of an index built from those that are left.
TEST(PointIndex, DroppedPointsAreNotFoundAnyMore) {
  std::mt19937_64 rng(4);
  std::uniform_real_distribution<double> place(-3.0, 3.0);
  std::vector<SurfacePoint> all;
  for (int i = 0; i < 4000; ++i) all.push_back(At(place(rng), place(rng)));
  PointIndex moving;
  constexpr std::size_t kStep = 100, kWindow = 600;
  for (std::size_t begin = 0, end = 0; end < all.size();) {
    for (const std::size_t stop = end + kStep; end < stop; ++end) moving.Add(all[end]);
    if (end - begin > kWindow) {
      moving.DropOldest(kStep);
      begin += kStep;
    }
    const PointIndex anew(std::span<const SurfacePoint>(all).subspan(begin, end - begin));
    ASSERT_EQ(moving.size(), anew.size());
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector2d p(place(rng), place(rng));
      const SurfacePoint *here = moving.Nearest(p, 0.3), *there = anew.Nearest(p, 0.3);
      ASSERT_EQ(here == nullptr, there == nullptr);
      if (here != nullptr) {
        EXPECT_EQ(here->p, there->p);
      }
    }
  }
}

// If every beam of one peer's scans ended at one place, each search used to take as long as all of them
// together.
TEST(PointIndex, OfACrowdOnlyTheLastAreCompared) {
  PointIndex index;
  const int crowd = PointIndex::kMaxInCell + 37;
  for (int i = 0; i < crowd; ++i) index.Add(At(1.0 + 1e-8 * i, 1.0));
  ASSERT_NE(index.Nearest({1.0, 1.0}, 0.5), nullptr);
  EXPECT_EQ(index.Nearest({1.0, 1.0}, 0.5)->p.x(), 1.0 + 1e-8 * 37);
  index.Add(At(3.0, 3.0));  // Others are not concerned.
  EXPECT_NE(index.Nearest({3.0, 3.0}, 0.5), nullptr);
}

TEST(PointIndex, IsEmptyAgainAfterClear) {
  PointIndex index;
  for (int i = 0; i < 2 * PointIndex::kMaxInCell; ++i) index.Add(At(1.0, 1.0));
  index.Clear();
  EXPECT_EQ(index.size(), 0U);
  EXPECT_EQ(index.Nearest({1.0, 1.0}, 0.5), nullptr);
  for (int i = 0; i < 5; ++i) index.Add(At(1.0, 1.0));
  EXPECT_EQ(index.size(), 5U);
}

}  // namespace
}  // namespace cairn::slam
