#include "server/slam/tracking/blind_motion.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

const OdometryNoise kNoise;

TrackStep Moved(double metres, bool matched) {
  TrackStep step;
  step.matched = matched;
  step.moved_m = metres;
  step.T_prev_curr_odom = {metres, 0.0, 0.0};
  return step;
}

// In a corridor that lies along y of `track`.
TrackStep AlongY(double metres, double information) {
  TrackStep step = Moved(metres, true);
  step.degenerate = true;
  step.open_direction = {0.0, 1.0};
  step.open_information = information;
  return step;
}

Eigen::Matrix3d After(const std::vector<TrackStep>& steps, const Pose2& T_track_keyframe = {}) {
  BlindMotion blind(kNoise, true, 2.0);
  for (const TrackStep& step : steps) blind.Add(step, T_track_keyframe);
  return blind.TakeCovariance();
}

TEST(OdometryNoise, DoesNotDependOnTheNumberOfStepsOfAMotion) {
  Eigen::Matrix3d of_ten = Eigen::Matrix3d::Zero();
  for (int i = 0; i < 10; ++i) of_ten += kNoise.Covariance({0.2, 0.0, -0.05});
  EXPECT_TRUE(of_ten.isApprox(kNoise.Covariance({2.0, 0.0, 0.5}), 1e-12));
  EXPECT_NEAR(std::sqrt(kNoise.Covariance(4.0, 0.0)(0, 0)), 2.0 * kNoise.trans_m_per_sqrt_m, 1e-12);
  EXPECT_NEAR(std::sqrt(kNoise.Covariance(0.0, 4.0)(2, 2)), 2.0 * kNoise.rot_rad_per_sqrt_rad, 1e-12);
}

TEST(BlindMotion, AddsTheDoubtOfOdometryWhereNothingMatches) {
  EXPECT_TRUE(After({Moved(0.5, false), Moved(1.5, false)}).isApprox(kNoise.Covariance(2.0, 0.0), 1e-12));
}

TEST(BlindMotion, EndsWhereAScanShowsThePositionAgain) {
  EXPECT_TRUE(After({Moved(0.5, false), Moved(0.5, true)}).isZero());
  EXPECT_TRUE(After({AlongY(0.5, 0.0), Moved(0.5, true)}).isZero());
}

TEST(BlindMotion, AlongACorridorIsThatOfOdometryAndAcrossItNone) {
  // The keyframe looks along the corridor, whose direction is x there.
  const Eigen::Matrix3d covariance = After({Moved(1.0, false), AlongY(1.0, 0.0)}, {3.0, 1.0, kPi / 2});
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  expected(0, 0) = kNoise.Covariance(2.0, 0.0)(0, 0);
  EXPECT_TRUE(covariance.isApprox(expected, 1e-9)) << covariance;
}

// A filter whose gain counts only the noise of one step: its variance is the fixed point of
// V = (1 - k)^2 (V + q) + k^2 / I.
TEST(BlindMotion, ConvergesToWhatSurfacesShowAsSlowlyAsTheyAreBelieved) {
  constexpr double kShown = 1.0 / (0.03 * 0.03), kStepM = 0.05;
  const double q = kNoise.Covariance(kStepM, 0.0)(1, 1), k = q * kShown / (1.0 + q * kShown);
  const double rest = (1.0 - k) * (1.0 - k), fixed_point = (rest * q + k * k / kShown) / (1.0 - rest);
  std::vector<TrackStep> steps(100, AlongY(0.5, 0.0));
  const double before = After(steps)(1, 1);
  steps.push_back(AlongY(kStepM, kShown));
  EXPECT_NEAR(After(steps)(1, 1), rest * (before + q) + k * k / kShown, 1e-9);
  steps.insert(steps.end(), 300, AlongY(kStepM, kShown));
  EXPECT_NEAR(After(steps)(1, 1), fixed_point, 1e-6);
  EXPECT_LT(fixed_point, 1.0 / kShown);
}

}  // namespace
}  // namespace cairn::slam
