#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "server/slam/scan/surface_points.h"

namespace cairn::slam {
namespace {

constexpr double kIndexCellM = 0.5;

SurfacePoint At(double x, double y) {
  SurfacePoint point;
  point.p = {x, y};
  return point;
}

// Over an area wider than the torus of buckets, so that far points share buckets with near ones.
TEST(PointIndex, FindsWhatLookingAtAllFinds) {
  std::mt19937_64 rng(3);
  std::uniform_real_distribution<double> place(-200.0, 200.0), near(-2.0, 2.0);
  PointIndex index(kIndexCellM);
  std::vector<SurfacePoint> all;
  for (int i = 0; i < 4000; ++i) {
    all.push_back(i % 2 == 0 ? At(place(rng), place(rng)) : At(near(rng), near(rng)));
    index.Add(all.back());
  }
  ASSERT_EQ(index.size(), all.size());
  int found = 0;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector2d p(near(rng), near(rng));
    const auto nearest = std::min_element(all.begin(), all.end(), [&](const SurfacePoint& a, const SurfacePoint& b) {
      return (a.p - p).squaredNorm() < (b.p - p).squaredNorm();
    });
    const SurfacePoint* answer = index.Nearest(p, kIndexCellM);
    if ((nearest->p - p).norm() > kIndexCellM) {
      EXPECT_EQ(answer, nullptr);
      continue;
    }
    ASSERT_NE(answer, nullptr);
    EXPECT_EQ(answer->p, nearest->p);
    ++found;
  }
  EXPECT_GT(found, 400);
}

// If every beam of one peer's scans ended at one place, each search used to take as long as all of them
// together.
TEST(PointIndex, NoCrowdMakesASearchLong) {
  PointIndex index(kIndexCellM);
  for (int i = 0; i < 40 * 8192; ++i) index.Add(At(1.0 + 1e-7 * i, 1.0));
  EXPECT_EQ(index.size(), PointIndex::kMaxInBucket);
  ASSERT_NE(index.Nearest({1.0, 1.0}, kIndexCellM), nullptr);
  EXPECT_EQ(index.Nearest({1.0, 1.0}, kIndexCellM)->p.x(), 1.0);
  index.Add(At(3.0, 3.0));  // Others are not concerned.
  EXPECT_NE(index.Nearest({3.0, 3.0}, kIndexCellM), nullptr);
}

TEST(PointIndex, IsEmptyAgainAfterClear) {
  PointIndex index(kIndexCellM);
  for (int i = 0; i < 2 * PointIndex::kMaxInBucket; ++i) index.Add(At(1.0, 1.0));
  index.Clear();
  EXPECT_EQ(index.size(), 0U);
  EXPECT_EQ(index.Nearest({1.0, 1.0}, kIndexCellM), nullptr);
  for (int i = 0; i < 5; ++i) index.Add(At(1.0, 1.0));
  EXPECT_EQ(index.size(), 5U);
}

}  // namespace
}  // namespace cairn::slam
