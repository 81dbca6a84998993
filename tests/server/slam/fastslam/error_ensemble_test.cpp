#include "server/slam/fastslam/error_ensemble.h"

#include <gtest/gtest.h>

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

  static Eigen::Matrix3d Noise() { return Eigen::Vector3d(4e-4, 1e-4, 1e-4).asDiagonal(); }
  // Keeps the keyframe it stands at, then drives on.
  void Step(ErrorEnsemble& errors, const Pose2& step, double spread_share = 1.0) {
    const Eigen::Matrix3d noise = Noise();
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

// After the fit of a circle whose end sees its beginning, the errors are those of the fit: small at the end, largest in
// the middle, and known relative to old keyframes as well.
TEST(ErrorEnsemble, ARebasedPathIsAsSureAsItsRelations) {
  ErrorEnsemble errors(5);
  Drive drive;
  for (int i = 0; i < 40; ++i) drive.Step(errors, {0.5, 0.0, kPi / 20});
  std::vector<PoseRelation> relations;
  for (std::size_t k = 1; k < drive.path.size(); ++k)
    relations.push_back({k - 1, k, Between(drive.path[k - 1], drive.path[k]), Drive::Noise(), false});
  const std::size_t last = drive.path.size() - 1;
  relations.push_back({0, last, Between(drive.path[0], drive.path[last]), kSight, true});
  errors.Rebase(drive.path, relations);
  const Eigen::Matrix3d claimed = errors.covariance(drive.path.back());
  EXPECT_NEAR(std::sqrt(claimed(0, 0)), 0.01, 0.004);
  EXPECT_NEAR(std::sqrt(claimed(2, 2)), 0.001, 0.0004);
  drive.T_map_robot = drive.path.back();
  SeeAgain(errors, drive, last / 2);  // What was seen in the middle of the circle is less certain than the beginning.
  EXPECT_LT(errors.covariance(drive.T_map_robot).trace(), 1.2 * claimed.trace());
  EXPECT_GT(errors.covariance(drive.T_map_robot).trace(), 0.3 * claimed.trace());
}

}  // namespace
}  // namespace cairn::slam
