#include "server/slam/fastslam/error_ensemble.h"

#include <gtest/gtest.h>

#include <vector>

#include "common/geometry/rotated_covariance.h"
#include "server/slam/filters/revisit_innovation.h"
#include "server/slam/motion/odometry_model.h"

namespace cairn::slam {
namespace {

// Root of the ratio of claimed to expected variance: 1 if the claim is right. With a hundred members it
// varies by 7 %.
void ExpectSpread(const Eigen::Matrix3d& claimed, const Eigen::Matrix3d& expected, double tolerance = 0.25) {
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(std::sqrt(claimed(i, i) / expected(i, i)), 1.0, tolerance) << "component " << i;
}

struct Drive {
  Pose2 T_map_robot{3.0, -2.0, 0.4};
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // Covariance of dead reckoning.
  std::vector<Pose2> path;

  // Keeps the keyframe it stands at, then drives on.
  void Step(ErrorEnsemble& errors, const Pose2& step, double spread_share = 1.0) {
    const Eigen::Matrix3d noise = Eigen::Vector3d(4e-4, 1e-4, 1e-4).asDiagonal();
    errors.Keep(spread_share);
    path.push_back(T_map_robot);
    errors.Move(T_map_robot, step, noise);
    DeadReckon(T_map_robot, covariance, step, noise);
  }
};

const Eigen::Matrix3d kSight = Eigen::Vector3d(1e-4, 1e-4, 1e-6).asDiagonal();

// The true pose of the robot equals the believed one, seen from a keyframe.
void SeeAgain(ErrorEnsemble& errors, const Drive& drive, std::size_t keyframe) {
  const RevisitObservation revisit{keyframe, Between(drive.path[keyframe], drive.T_map_robot), kSight};
  errors.Constrain<3>(keyframe, drive.T_map_robot, InnovateRevisit(drive.path[keyframe], drive.T_map_robot, revisit));
}

TEST(ErrorEnsemble, DriftsAsDeadReckoningDoes) {
  ErrorEnsemble errors(1);
  EXPECT_EQ(errors.covariance({5, 5, 1}), Eigen::Matrix3d::Zero());
  Drive drive;
  for (int i = 0; i < 40; ++i) drive.Step(errors, {0.5, 0.0, 0.05});
  ExpectSpread(errors.covariance(drive.T_map_robot), drive.covariance);
}

TEST(ErrorEnsemble, AKnownPlaceSeenAgainMakesThePoseAsSureAsTheSight) {
  ErrorEnsemble errors(2);
  Drive drive;
  for (int i = 0; i < 40; ++i) drive.Step(errors, {0.5, 0.0, kPi / 20});
  SeeAgain(errors, drive, 0);  // The robot is back where the circle began.
  const Eigen::Matrix3d claimed = errors.covariance(drive.T_map_robot);
  EXPECT_NEAR(std::sqrt(claimed(0, 0)), 0.01, 0.004);
  EXPECT_NEAR(std::sqrt(claimed(2, 2)), 0.001, 0.0004);
}

TEST(ErrorEnsemble, AnUncertainPlaceSeenAgainIsAsUncertainAsItWas) {
  ErrorEnsemble errors(3);
  Drive drive;
  for (int i = 0; i < 40; ++i) drive.Step(errors, {0.5, 0.0, 0.0});
  const Drive then = drive;
  for (int i = 0; i < 40; ++i) drive.Step(errors, {0.5, 0.0, kPi / 20});
  EXPECT_GT(drive.covariance(2, 2), 1.5 * then.covariance(2, 2));
  // However often it is seen again, the error of the path to it does not become visible.
  for (int i = 0; i < 20; ++i) SeeAgain(errors, drive, 40);
  ExpectSpread(errors.covariance(drive.T_map_robot), then.covariance, 0.3);
}

TEST(ErrorEnsemble, OneAncestorLeftErrsByAsMuchAsItWasDrawnFrom) {
  ErrorEnsemble errors(4);
  Drive drive;
  for (int i = 0; i < 20; ++i) drive.Step(errors, {0.5, 0.0, 0.0});
  const Eigen::Matrix3d before = errors.covariance(drive.T_map_robot);
  errors.Resample(0.0);
  EXPECT_EQ(errors.covariance(drive.T_map_robot), before);
  errors.Resample(1.0);
  const Eigen::Matrix3d after = errors.covariance(drive.T_map_robot);
  ExpectSpread(after, 2.0 * before);
  errors.Resample(1.0);  // One member is left, so no more can be lost.
  EXPECT_EQ(errors.covariance(drive.T_map_robot), after);
}

TEST(ErrorEnsemble, ARebasedPathIsKnown) {
  ErrorEnsemble errors(5);
  Drive drive;
  for (int i = 0; i < 40; ++i) drive.Step(errors, {0.5, 0.0, 0.0});
  const Eigen::Matrix3d doubt = Eigen::Vector3d(0.04, 0.01, 0.0004).asDiagonal();
  errors.Rebase(drive.path.size(), drive.T_map_robot, doubt);
  ExpectSpread(errors.covariance(drive.T_map_robot), doubt);
  SeeAgain(errors, drive, 20);
  EXPECT_LT(errors.covariance(drive.T_map_robot).trace(), 0.02 * doubt.trace());
}

// As seen from the robot nothing has changed.
TEST(ErrorEnsemble, AMovedMapKeepsTheDoubt) {
  ErrorEnsemble errors(6), moved(6);
  Drive drive, moved_drive;
  for (int i = 0; i < 40; ++i) drive.Step(errors, {0.5, 0.0, 0.0});
  for (int i = 0; i < 40; ++i) moved_drive.Step(moved, {0.5, 0.0, 0.0});
  const Pose2 T_new_old{30.0, -20.0, 1.5};
  moved.MoveMap(std::vector<Pose2>(drive.path.size(), T_new_old));
  const Eigen::Matrix3d here = Rotated(errors.covariance(drive.T_map_robot), T_new_old.theta);
  EXPECT_LT((moved.covariance(T_new_old * drive.T_map_robot) - here).norm(), 1e-3 * here.norm());
  // What is seen again is as good evidence as before.
  SeeAgain(errors, drive, 20);
  moved_drive.T_map_robot = T_new_old * moved_drive.T_map_robot;
  for (Pose2& pose : moved_drive.path) pose = T_new_old * pose;
  SeeAgain(moved, moved_drive, 20);
  const Eigen::Matrix3d again = Rotated(errors.covariance(drive.T_map_robot), T_new_old.theta);
  EXPECT_LT((moved.covariance(moved_drive.T_map_robot) - again).norm(), 0.3 * again.norm());
}

}  // namespace
}  // namespace cairn::slam
