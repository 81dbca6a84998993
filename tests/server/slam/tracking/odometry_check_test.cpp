#include "server/slam/tracking/odometry_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace cairn::slam {
namespace {

using Points = std::vector<SurfacePoint>;

// A face across the corridor, towards the robot.
void AddFaceAcross(double x, double y_min, double y_max, Points& points) {
  for (double y = y_min; y < y_max + 1e-9; y += 0.05) points.push_back({{x, y}, {-1.0, 0.0}});
}

// Two walls along x, and the sides of some niches.
Points CorridorWithNiches(int niches) {
  Points points;
  for (double x = 0.5; x < 8.0; x += 0.1) {
    points.push_back({{x, 1.2}, {0.0, -1.0}});
    points.push_back({{x, -1.2}, {0.0, 1.0}});
  }
  for (int i = 0; i < niches; ++i) AddFaceAcross(2.0 + 2.0 * i, 1.0, 1.1, points);
  return points;
}

Points SeenFrom(double x, Points points) {
  for (SurfacePoint& point : points) point.p.x() -= x;
  return points;
}

MatchResult MatchAt(const Pose2& T_track_robot) {
  MatchResult match;
  match.T_ref_curr = T_track_robot;
  match.covariance = PoseCovariance(0.01, 0.002);
  match.score = 0.9;
  match.converged = true;
  return match;
}

// Odometry has driven this step.
MatchResult Check(const Points& seen, const Points& reference, const Pose2& odometry, const MatchResult& match) {
  return CheckAgainstOdometry(seen, PointIndex(reference), {{}, odometry, PoseCovariance(0.05, 0.02)}, match, {});
}

// What walks ahead is in the reference and in the scan at the same place.
TEST(OdometryCheck, AMatchThatHoldsTheRobotBackMustBeShownByMoreSurfacesThanOdometry) {
  Points reference = CorridorWithNiches(3), seen = SeenFrom(0.1, reference);
  AddFaceAcross(1.2, -0.2, 0.2, reference);
  AddFaceAcross(1.2, -0.2, 0.2, seen);
  const MatchResult checked = Check(seen, reference, {0.1, 0.0, 0.0}, MatchAt({}));
  EXPECT_TRUE(checked.converged);
  EXPECT_NEAR(checked.T_ref_curr.x, 0.1, 0.01);
  EXPECT_TRUE(checked.degenerate) << "no surface shows how far the robot has driven";
  EXPECT_NEAR(std::abs(checked.degenerate_direction.x()), 1.0, 1e-6);
  EXPECT_GE(checked.covariance(0, 0), 0.05 * 0.05);
  EXPECT_LT(checked.covariance(1, 1), 0.05 * 0.05);
}

TEST(OdometryCheck, WhereSurfacesShowThatTheWheelsSlipTheMatchStays) {
  const Points corridor = CorridorWithNiches(3);
  const MatchResult checked = Check(corridor, corridor, {0.1, 0.0, 0.0}, MatchAt({}));
  EXPECT_EQ(checked.T_ref_curr, Pose2{});
  EXPECT_FALSE(checked.degenerate);
}

// Two surfaces are not enough where the robot is held back by all of its step, but where it is not.
TEST(OdometryCheck, AMatchThatDoesNotHoldTheRobotBackNeedsFewerSurfaces) {
  const Points corridor = CorridorWithNiches(2);
  EXPECT_NE(Check(corridor, corridor, {0.1, 0.0, 0.0}, MatchAt({})).T_ref_curr, Pose2{});
  const Points seen = SeenFrom(0.2, corridor);
  EXPECT_EQ(Check(seen, corridor, {0.1, 0.0, 0.0}, MatchAt({0.2, 0.0, 0.0})).T_ref_curr, (Pose2{0.2, 0.0, 0.0}));
}

TEST(OdometryCheck, SmallDifferencesAndTurnsAreNotChecked) {
  Points reference = CorridorWithNiches(3), seen = SeenFrom(0.1, reference);
  EXPECT_EQ(Check(seen, reference, {0.1, 0.0, 0.0}, MatchAt({0.075, 0.0, 0.0})).T_ref_curr, (Pose2{0.075, 0.0, 0.0}));
  EXPECT_EQ(Check(seen, reference, {0.1, 0.0, 0.12}, MatchAt({})).T_ref_curr, Pose2{});
}

}  // namespace
}  // namespace cairn::slam
