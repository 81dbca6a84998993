#include "server/slam/filters/fastslam2.h"

#include <gtest/gtest.h>

#include <cmath>

namespace cairn::slam {
namespace {

constexpr std::int64_t kParticles = 100;

FastSlamOptions Wide() {
  FastSlamOptions options;
  options.drift = {0.0, 0.05, 0.0, 0.0, 0.02, 0.0};
  return options;
}

// Ten metres out, turn about, ten metres back: the true end is the start, facing back.
void DriveOutAndBack(FastSlam2& filter) {
  const auto step = [&](const Pose2& T_prev_curr) {
    filter.Predict(T_prev_curr, Eigen::Matrix3d::Zero());
    filter.Commit();
  };
  filter.Commit();
  for (int i = 0; i < 20; ++i) step({0.5, 0, 0});
  step({0, 0, kPi});
  for (int i = 0; i < 20; ++i) step({0.5, 0, 0});
}

TEST(FastSlam2, UncertaintyGrowsAlongThePathAndARevisitTakesItAway) {
  FastSlam2 filter(Wide(), {}, kParticles, {}, 1);
  DriveOutAndBack(filter);
  const double before = filter.estimate().covariance.topLeftCorner<2, 2>().trace();
  RevisitObservation revisit{0, {0, 0, kPi}, Eigen::Vector3d(0.0025, 0.0025, 0.0004).asDiagonal()};
  for (int i = 0; i < 5; ++i) {
    filter.Predict({0, 0, 0}, Eigen::Matrix3d::Zero());
    ASSERT_TRUE(filter.Observe(revisit));
    filter.Commit();
  }
  const double after = filter.estimate().covariance.topLeftCorner<2, 2>().trace();
  EXPECT_LT(after, 0.3 * before);
  EXPECT_LT(filter.estimate().T_map_robot.translation().norm(), 0.15);
}

TEST(FastSlam2, ARevisitNoParticleExplainsChangesNothing) {
  FastSlam2 filter(Wide(), {}, kParticles, {}, 1);
  DriveOutAndBack(filter);
  const Pose2 before = filter.best().T_map_robot;
  EXPECT_FALSE(filter.Observe({0, {50, 0, 0}, Eigen::Matrix3d::Identity() * 1e-4}));
  EXPECT_EQ(filter.best().T_map_robot, before);
}

TEST(FastSlam2, ALandmarkSeenAgainPullsTheRobotBack) {
  FastSlam2 filter(Wide(), {}, kParticles, {}, 3);
  filter.Observe(std::vector<LandmarkObservation>{{0, false, {2.0, 1.0}, 0.3}, {1, false, {1.0, -2.0}, 1.2}});
  filter.Commit();
  ASSERT_EQ(filter.landmark_count(), 2U);
  // The motion says 0.3 m sideways; the landmarks say it did not happen.
  for (int i = 0; i < 8; ++i) {
    filter.Predict({0, i == 0 ? 0.3 : 0.0, 0}, Eigen::Matrix3d::Identity() * 0.02);
    filter.Observe(std::vector<LandmarkObservation>{{0, true, {2.0, 1.0}, 0.3}, {1, true, {1.0, -2.0}, 1.2}});
    filter.Commit();
  }
  EXPECT_LT(filter.estimate().T_map_robot.translation().norm(), 0.12);
  EXPECT_GT(filter.best().landmarks[0].sightings, 5U);
}

TEST(FastSlam2, SameSeedSameParticles) {
  FastSlam2 a(Wide(), {}, kParticles, {}, 42), b(Wide(), {}, kParticles, {}, 42);
  DriveOutAndBack(a);
  DriveOutAndBack(b);
  for (std::size_t i = 0; i < a.particles().size(); ++i)
    ASSERT_EQ(a.particles()[i].T_map_robot, b.particles()[i].T_map_robot);
}

TEST(FastSlam2, EveryParticleKeepsItsWholePath) {
  FastSlam2 filter(Wide(), {}, kParticles, {}, 5);
  DriveOutAndBack(filter);
  for (const Particle& particle : filter.particles()) {
    ASSERT_EQ(particle.path.size(), 42U);
    EXPECT_EQ(particle.path[0], Pose2{});
  }
}

}  // namespace
}  // namespace cairn::slam
