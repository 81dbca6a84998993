#include "client/sim/ray_caster.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "client/sim/random.h"
#include "common/geometry/angle.h"

namespace cairn::sim {
namespace {

std::vector<Segment> Square(double half) {
  return {{{-half, -half}, {half, -half}},
          {{half, -half}, {half, half}},
          {{half, half}, {-half, half}},
          {{-half, half}, {-half, -half}}};
}

// The definition itself: every segment, solved as a 2 x 2 system.
double BruteForce(const std::vector<Segment>& segments, const Eigen::Vector2d& origin, const Eigen::Vector2d& direction,
                  double max_m) {
  double nearest = kNothingHit;
  for (const Segment& s : segments) {
    Eigen::Matrix2d A;
    A << direction, s.a_map - s.b_map;
    if (std::abs(A.determinant()) < 1e-12) continue;
    const Eigen::Vector2d solution = A.inverse() * (s.a_map - origin);
    if (solution.x() >= 0 && solution.y() >= -1e-9 && solution.y() <= 1 + 1e-9)
      nearest = std::min(nearest, solution.x());
  }
  return nearest <= max_m ? nearest : kNothingHit;
}

TEST(RayCaster, IsExactInASquareRoom) {
  const RayCaster walls(Square(3.0));
  for (int i = 0; i < 720; ++i) {
    const double angle = i * kPi / 360;
    const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
    EXPECT_NEAR(walls.Cast({0, 0}, direction, 100), 3.0 / direction.cwiseAbs().maxCoeff(), 1e-9) << angle;
  }
}

TEST(RayCaster, AgreesWithEverySegmentTriedInTurn) {
  Random random(7);
  std::uniform_real_distribution<double> place(-20, 20), length(-4, 4), angle(-kPi, kPi);
  std::vector<Segment> segments;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector2d a(place(random), place(random));
    segments.push_back({a, a + Eigen::Vector2d(length(random), length(random))});
  }
  const RayCaster walls(segments);
  int hits = 0;
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector2d origin(1.3 * place(random), 1.3 * place(random));
    const double a = i % 10 == 0 ? kPi / 2 * (i / 10 % 4) : angle(random);  // Also along the axes.
    const Eigen::Vector2d direction(std::cos(a), std::sin(a));
    const double expected = BruteForce(segments, origin, direction, 25.0), got = walls.Cast(origin, direction, 25.0);
    if (expected == kNothingHit) {
      EXPECT_EQ(got, kNothingHit);
    } else {
      EXPECT_NEAR(got, expected, 1e-9);
      ++hits;
    }
  }
  EXPECT_GT(hits, 2500);
}

TEST(RayCaster, SeesNothingBeyondTheLimitOrOutside) {
  const RayCaster walls(Square(3.0));
  EXPECT_EQ(walls.Cast({0, 0}, {1, 0}, 2.99), kNothingHit);
  EXPECT_NEAR(walls.Cast({0, 0}, {1, 0}, 3.01), 3.0, 1e-12);
  EXPECT_EQ(walls.Cast({5, 0}, {1, 0}, 100), kNothingHit);
  EXPECT_NEAR(walls.Cast({50, 0}, {-1, 0}, 100), 47.0, 1e-9);
  EXPECT_EQ(RayCaster({}).Cast({0, 0}, {1, 0}, 100), kNothingHit);
}

TEST(RayCaster, HitsADiscAtItsRimUnlessInside) {
  const Disc disc{{4, 1}, 0.5};
  EXPECT_NEAR(CastAtDisc(disc, {0, 1}, {1, 0}), 3.5, 1e-12);
  EXPECT_NEAR(CastAtDisc(disc, {0, 1.3}, {1, 0}), 4.0 - 0.4, 1e-12);
  EXPECT_EQ(CastAtDisc(disc, {0, 1.51}, {1, 0}), kNothingHit);
  EXPECT_EQ(CastAtDisc(disc, {0, 1}, {-1, 0}), kNothingHit);
  EXPECT_EQ(CastAtDisc(disc, {4.2, 1}, {1, 0}), kNothingHit);
}

}  // namespace
}  // namespace cairn::sim
