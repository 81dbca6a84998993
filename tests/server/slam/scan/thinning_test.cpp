#include "server/slam/scan/thinning.h"

#include <gtest/gtest.h>

#include <limits>

#include "server/slam/scan/beam_points.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

using Points = std::vector<Eigen::Vector2d>;

Points HitsOf(const Scan& scan) {
  Points hits;
  for (const BeamPoint& hit : PointsOf(scan)) hits.push_back(hit.p_robot);
  return hits;
}

double LeastDistance(const Points& points) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) least = std::min(least, (points[i] - points[j]).norm());
  return least;
}

TEST(Thinning, ACloudBecomesItsCentreOfGravity) {
  const Points points = {{0, 0}, {0.06, 0}, {0, 0.03}, {1, 1}};
  const Points thinned = ThinByCentreOfGravity(points, {});
  ASSERT_EQ(thinned.size(), 2U);
  EXPECT_NEAR((thinned[0] - Eigen::Vector2d(0.02, 0.01)).norm(), 0.0, 1e-12);
  EXPECT_EQ(thinned[1], Eigen::Vector2d(1, 1));
}

// Figure 4.18 of the thesis: a robot close to the wall on its right, 181 beams, 59 points left. The drawn
// room is not given in numbers; this one is like it.
TEST(Thinning, AScanBesideAWallKeepsAThirdOfItsPoints) {
  const Scan scan = test::Look(test::Room(-1, -0.35, 4.0, 2.6), {}, {});
  const Points hits = HitsOf(scan);
  ASSERT_EQ(hits.size(), 181U);
  const Points thinned = ThinByCentreOfGravity(hits, {});
  EXPECT_GE(thinned.size(), 50U);
  EXPECT_LE(thinned.size(), 70U);
  EXPECT_GE(LeastDistance(thinned), ThinningOptions{}.window_m);
  // What is left still lies on the walls; only around corners a centre may leave them a little.
  for (const Eigen::Vector2d& p : thinned) {
    const double off = std::min({std::abs(p.y() + 0.35), std::abs(p.y() - 2.25), std::abs(p.x() - 3.0)});
    EXPECT_LT(off, 0.05);
  }
}

TEST(Thinning, NoWindowKeepsEveryPointAndAWiderOneFewer) {
  const Points hits = HitsOf(test::Look(test::Office(), {}, {}));
  EXPECT_EQ(ThinByCentreOfGravity(hits, {.window_m = 0.0}), hits);
  const std::size_t at_10_cm = ThinByCentreOfGravity(hits, {.window_m = 0.1}).size();
  const std::size_t at_30_cm = ThinByCentreOfGravity(hits, {.window_m = 0.3}).size();
  EXPECT_LT(at_30_cm, at_10_cm);
  EXPECT_LT(at_10_cm, hits.size());
}

TEST(Thinning, TheWeightOfACloudIsItsReadings) {
  // Two windows whose centres come nearer to each other than the window: all six readings count alike.
  const Points points = {{0, 0}, {0.09, 0}, {0.09, 0}, {0.11, 0}, {0.11, 0}, {0.11, 0}};
  const Points thinned = ThinByCentreOfGravity(points, {});
  ASSERT_EQ(thinned.size(), 1U);
  EXPECT_NEAR(thinned[0].x(), 0.51 / 6.0, 1e-12);
}

TEST(Thinning, BadPointsAreLeftOutAndFarOnesDoNotOverflow) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(ThinByCentreOfGravity(Points{}, {}).empty());
  EXPECT_TRUE(ThinByCentreOfGravity(Points{{nan, 0}, {0, nan}}, {}).empty());
  EXPECT_EQ(ThinByCentreOfGravity(Points{{1e300, -1e300}, {0, 0}}, {}).size(), 2U);
  EXPECT_EQ(ThinByCentreOfGravity(Points(8192, Eigen::Vector2d(3, 4)), {}), (Points{{3, 4}}));
}

}  // namespace
}  // namespace cairn::slam
