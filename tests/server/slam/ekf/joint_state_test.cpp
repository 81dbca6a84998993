#include "server/slam/ekf/joint_state.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "server/slam/landmarks/landmark_sighting.h"
#include "server/slam/state/archive.h"

namespace cairn::slam {
namespace {

const Eigen::Matrix3d kStep = Eigen::Vector3d(0.01, 0.01, 0.001).asDiagonal();
const Eigen::Matrix2d kNoise = Eigen::Vector2d(0.01, 0.0009).asDiagonal();

JointState Moved() {
  JointState state({1.0, 2.0, 0.5});
  state.Move({1.0, 0.1, 0.2}, kStep);
  return state;
}

TEST(JointState, ANewPointIsAsUncertainAsPoseAndMeasurementMakeIt) {
  // Monte Carlo of (4.12) is the oracle of (4.15), (4.18), (4.19).
  JointState state = Moved();
  const Eigen::Vector2d z(2.0, 0.7);
  const Eigen::Index at = state.AddPoint(z, kNoise);
  const Eigen::LLT<Eigen::Matrix3d> pose_root(state.covariance<3, 3>(0, 0));
  std::mt19937_64 rng(1);
  std::normal_distribution<double> normal;
  Eigen::Matrix2d points = Eigen::Matrix2d::Zero();
  Eigen::Matrix<double, 2, 3> cross = Eigen::Matrix<double, 2, 3>::Zero();
  constexpr int kDraws = 40000;
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::Vector3d d = pose_root.matrixL() * Eigen::Vector3d(normal(rng), normal(rng), normal(rng));
    const double r = z.x() + 0.1 * normal(rng), b = z.y() + 0.03 * normal(rng);
    const double course = state.robot().theta + d.z() + b;
    const Eigen::Vector2d p =
        state.robot().translation() + d.head<2>() + r * Eigen::Vector2d(std::cos(course), std::sin(course));
    const Eigen::Vector2d error = p - state.point(at);
    points += error * error.transpose() / kDraws;
    cross += error * d.transpose() / kDraws;
  }
  EXPECT_LT((state.covariance<2, 2>(at, at) - points).cwiseAbs().maxCoeff(), 0.02 * points.maxCoeff());
  EXPECT_LT((state.covariance<2, 3>(at, 0) - cross).cwiseAbs().maxCoeff(), 0.0005);
}

TEST(JointState, SeeingTheSamePointAgainTellsNothingAboutThePoseButMoreAboutThePoint) {
  JointState state = Moved();
  const Eigen::Vector2d z(2.0, 0.7);
  const Eigen::Index at = state.AddPoint(z, kNoise);
  const Eigen::Matrix3d pose_before = state.covariance<3, 3>(0, 0);
  const double point_before = state.covariance<2, 2>(at, at).trace();
  const RangeBearing expected = PredictRangeBearing(state.robot(), state.point(at));
  EXPECT_LT((expected.z - z).norm(), 1e-12);
  const Eigen::Matrix2d S = state.InnovationCovariance<2, 2>(expected.J_z_pose, at, expected.J_z_point, kNoise);
  EXPECT_LT((S - 2.0 * kNoise).cwiseAbs().maxCoeff(), 1e-9) << "two measurements of one distance";
  state.Update<2, 2>(Eigen::Vector2d::Zero(), expected.J_z_pose, at, expected.J_z_point, kNoise);
  EXPECT_LT((state.covariance<3, 3>(0, 0) - pose_before).cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((state.covariance<2, 2>(at, at).trace()), point_before - 1e-6);
  EXPECT_LT((state.covariance<2, 2>(at, at) - state.covariance<2, 2>(at, at).transpose()).norm(), 1e-12);
}

TEST(JointState, ALandmarkTiesThePoseToItsPast) {
  JointState state({0, 0, 0});
  const Eigen::Vector2d z(2.0, 0.7);
  const Eigen::Index at = state.AddPoint(z, kNoise);
  for (int i = 0; i < 10; ++i) state.Move({0.0, 0.0, 0.0}, kStep);
  const double before = state.covariance<2, 2>(0, 0).trace();
  const RangeBearing expected = PredictRangeBearing(state.robot(), state.point(at));
  state.Update<2, 2>(Eigen::Vector2d::Zero(), expected.J_z_pose, at, expected.J_z_point, kNoise);
  EXPECT_LT((state.covariance<2, 2>(0, 0).trace()), 0.7 * before);
}

TEST(JointState, ACloneIsTheRobotUntilTheRobotMoves) {
  JointState state = Moved();
  const Eigen::Index at = state.AddRobotPose();
  EXPECT_EQ(state.pose(at), state.robot());
  EXPECT_TRUE((state.covariance<3, 3>(at, at) == state.covariance<3, 3>(0, at)));
  const Eigen::Matrix3d clone = state.covariance<3, 3>(at, at);
  state.Move({1, 0, 0}, kStep);
  EXPECT_TRUE((state.covariance<3, 3>(at, at) == clone));
  EXPECT_GT((state.covariance<2, 2>(0, 0).trace()), (clone.topLeftCorner<2, 2>().trace()));
}

// A turn of everything is another choice of axes: the covariance is that of a robot that drove the same way there.
TEST(JointState, ATurnedStateIsAsUncertainAlongTheTurnedAxes) {
  const Pose2 start{1.0, 2.0, 0.5}, turn{0, 0, 0.8};
  const Eigen::Matrix3d along = Eigen::Vector3d(0.04, 0.0001, 0.001).asDiagonal();
  const auto drive = [&](const Pose2& from) {
    JointState state(from);
    state.Move({3.0, 0.1, 0.2}, along);
    state.AddPoint({2.0, 0.7}, kNoise);
    return state;
  };
  JointState state = drive(start);
  const JointState expected = drive(turn * start);
  state.Turn(0, turn.theta);
  state.Turn(3, turn.theta);
  EXPECT_LT((state.covariance<5, 5>(0, 0) - expected.covariance<5, 5>(0, 0)).norm(), 1e-12);
}

TEST(JointState, LeavingAnEntryOutChangesNothingElse) {
  JointState state = Moved();
  const Eigen::Index a = state.AddPoint({2.0, 0.7}, kNoise);
  const Eigen::Index pose = state.AddRobotPose();
  const Eigen::Index b = state.AddPoint({1.0, -0.7}, kNoise);
  state.Move({1, 0, 0.1}, kStep);
  const Eigen::Vector2d point = state.point(b);
  const Pose2 old = state.pose(pose);
  const Eigen::Matrix2d covariance = state.covariance<2, 2>(b, b);
  const Eigen::Matrix<double, 3, 2> cross = state.covariance<3, 2>(0, b);
  state.Remove(a, 2);
  EXPECT_EQ(state.size(), 8);
  EXPECT_EQ(state.point(b - 2), point);
  EXPECT_EQ(state.pose(pose - 2), old);
  EXPECT_TRUE((state.covariance<2, 2>(b - 2, b - 2) == covariance));
  EXPECT_TRUE((state.covariance<3, 2>(0, b - 2) == cross));
}

// Whether a state of these sizes is read, followed by the numbers of a state with three elements.
bool IsRead(std::int64_t size, std::int64_t capacity) {
  StateWriter writer;
  writer(size, capacity, std::vector<Eigen::Index>{2});
  for (int i = 0; i < 3 + 3 * 3; ++i) writer(1.0);
  const std::string bytes = writer.Bytes();
  StateReader reader(bytes);
  JointState state(Pose2{});
  reader(state);
  return reader.done();
}

// Sizes come from a file. They must take neither an overflow nor more memory than the file has numbers for.
TEST(JointState, SizesForWhichThereAreNoNumbersAreNotRead) {
  constexpr std::int64_t kLargest = std::numeric_limits<std::int64_t>::max();
  EXPECT_TRUE(IsRead(3, 3));
  EXPECT_TRUE(IsRead(3, 12));
  EXPECT_FALSE(IsRead(3, 13));
  EXPECT_FALSE(IsRead(3, 2));
  EXPECT_FALSE(IsRead(2, 3));
  EXPECT_FALSE(IsRead(-3, 3));
  EXPECT_FALSE(IsRead(50000, 50000));
  EXPECT_FALSE(IsRead(kLargest / 3, kLargest));
  EXPECT_FALSE(IsRead(kLargest, kLargest));
}

}  // namespace
}  // namespace cairn::slam
