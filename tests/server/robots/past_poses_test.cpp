// What a session answers about the past after its robot's map was corrected.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/robots/room_robot.h"
#include "tests/server/robots/slipping_drive.h"

namespace cairn::server {
namespace {

using testing::RoomScan;

constexpr double kPastCellM = 0.05;

struct MappingRobot : testing::RoomRobot {
  explicit MappingRobot(bool fragment = false) : MappingRobot(SetupOf(fragment)) {}
  explicit MappingRobot(const EstimatorSetup& setup) : RoomRobot(setup) {}

  static EstimatorSetup SetupOf(bool fragment) {
    EstimatorSetup setup = FewParticles();
    setup.fragment = fragment;
    return setup;
  }
  SessionMaterial Material() {
    SessionMaterial taken;
    estimator.Handle(SnapshotWanted{[&taken](SessionMaterial&& material) { taken = std::move(material); }});
    return taken;
  }
  slam::MapperSnapshot Snapshot() { return Material().snapshot; }
  // The whole path as it would be after a job that found a turn of `turn_rad` at each keyframe, moved by `T_new_old`.
  RobotGrid Corrected(const Pose2& T_new_old, double turn_rad) {
    std::vector<Pose2> path = Snapshot().full_path;
    for (std::size_t k = 0; k < path.size(); ++k)
      path[k] = T_new_old * Pose2{0.0, 0.0, turn_rad * static_cast<double>(k)} * path[k];
    const std::uint64_t keyframes = path.size();
    return {.chunks = {}, .keyframes = keyframes, .path = std::make_shared<const std::vector<Pose2>>(std::move(path))};
  }
  // Returns what was there before.
  RobotGrid Adopt(std::uint32_t epoch, RobotGrid grid) {
    RobotGrid displaced;
    estimator.Handle(Correction{.epoch = epoch,
                                .generation = epoch,
                                .grid = std::move(grid),
                                .done = [&](Adopted&& adopted) { displaced = std::move(adopted.displaced); },
                                .completed = std::make_shared<std::atomic<bool>>(true)});
    return displaced;
  }
  [[nodiscard]] PathView path() const { return record.snapshot().path; }
  [[nodiscard]] std::vector<PathPose> Poses() const {
    const PathView view = path();
    std::vector<PathPose> poses;
    for (std::size_t i = 0; i < view.blocks(); ++i)
      poses.insert(poses.end(), view.block(i).begin(), view.block(i).end());
    return poses;
  }
  // The tiles are drawn along the path of the estimator: so the answers must lie on it.
  void ExpectAnswersOnPath() {
    const Trajectory along = Snapshot().FullTrajectory();
    const PathView answers = path();
    ASSERT_EQ(along.size(), answers.size());
    const std::vector<PathPose> poses = Poses();
    for (std::size_t i = 0; i < along.size(); ++i) {
      const auto pose = answers.At(along[i].stamp);
      ASSERT_TRUE(pose);
      const Pose2 error = Between(along[i].T_map_robot, pose->T_map_robot);
      EXPECT_LT(error.translation().norm(), kPastCellM) << i;
      EXPECT_LT(std::abs(error.theta), 0.03) << i;
      EXPECT_EQ(poses[i].stamp, along[i].stamp);
      EXPECT_EQ(poses[i].T_map_robot, pose->T_map_robot);
      if (i == 0) continue;
      const auto between = answers.At((along[i - 1].stamp + along[i].stamp) / 2);
      const Pose2 middle = Interpolate(along[i - 1].T_map_robot, along[i].T_map_robot, 0.5);
      EXPECT_LT((between->T_map_robot.translation() - middle.translation()).norm(), kPastCellM) << i;
    }
  }
};

TEST(PastPoses, ASwitchOfTheMapMovesThemWithTheKeyframesNextToThem) {
  MappingRobot robot;
  robot.Drive(0, 60);
  const PathView published = robot.path();
  const RobotGrid first = robot.Adopt(9, robot.Corrected({2.0, 1.0, 0.3}, 0.002));
  robot.ExpectAnswersOnPath();
  const Stamp early = RoomScan(5).stamp;
  EXPECT_GT(Between(published.At(early)->T_map_robot, robot.path().At(early)->T_map_robot).translation().norm(), 1.0);
  const Pose2 last = robot.record.snapshot().status.pose.T_map_robot;
  EXPECT_LT(Between(last, robot.path().At(robot.path().last_stamp())->T_map_robot).translation().norm(), kPastCellM);
  robot.Drive(60, 90);
  robot.Adopt(10, robot.Corrected({-1.0, 0.5, 0.1}, -0.001));
  robot.ExpectAnswersOnPath();
  robot.Drive(90, 100);
  robot.Adopt(11, RobotGrid(first));  // Back to the first map, of which the last keyframes know nothing.
  robot.ExpectAnswersOnPath();
  EXPECT_LT(Between(published.At(early)->T_map_robot, robot.path().At(early)->T_map_robot).translation().norm(),
            kPastCellM);
}

TEST(PastPoses, ALargeLoopOfTheRobotItselfMovesThem) {
  EstimatorSetup setup;
  setup.mapper.filter.particles = 50;
  setup.mapper.filter.back_end.landmarks.enabled = false;  // The landmarks alone would nearly correct the drift.
  MappingRobot robot(setup);
  Pose2 true_then, published;
  testing::DriveWithASlip([&](const Odometry& odometry, Scan scan) { robot.Take(odometry, std::move(scan)); },
                          [&](const Pose2& truth) {
                            true_then = truth;
                            published = robot.record.snapshot().status.pose.T_map_robot;
                          });
  const auto now = robot.path().At(static_cast<Stamp>(testing::kAfterTheSlip) * testing::kSlippingPeriod);
  ASSERT_TRUE(now);
  const double before_m = Between(true_then, published).translation().norm();
  EXPECT_GT(before_m, 0.3) << "the path must need correcting";
  EXPECT_LT(Between(true_then, now->T_map_robot).translation().norm(), 0.5 * before_m);
}

TEST(PastPoses, OnesThatHaveMovedAreThereAfterARestart) {
  MappingRobot robot;
  robot.Drive(0, 40);
  robot.Adopt(9, robot.Corrected({2.0, 1.0, 0.3}, 0.002));
  robot.Drive(40, 45);
  const auto save = robot.estimator.Save();
  ASSERT_TRUE(save);
  const CheckpointContent content = save();
  std::vector<std::string> pieces;
  for (const CheckpointPiece& piece : content.pieces) pieces.push_back(piece.bytes());
  MappingRobot other;
  ASSERT_TRUE(other.estimator.Load(content.main, std::vector<std::string_view>(pieces.begin(), pieces.end())));
  for (MappingRobot* const one : {&robot, &other}) {
    one->Adopt(10, one->Corrected({0.0, 0.0, 0.2}, 0.0));
    one->Drive(45, 50);
  }
  const std::vector<PathPose> here = robot.Poses(), there = other.Poses();
  ASSERT_EQ(here.size(), there.size());
  for (std::size_t i = 0; i < here.size(); ++i) EXPECT_EQ(here[i].T_map_robot, there[i].T_map_robot) << i;
}

TEST(PastPoses, ThoseOfAFragmentLieInTheMapOnceItHasJoinedAndNoLongerWhenItIsTakenOut) {
  MappingRobot robot(true);
  robot.Drive(0, 40);
  const Stamp early = RoomScan(5).stamp;
  const PathPose alone = *robot.path().At(early);
  EXPECT_EQ(alone.reason, PoseReason::kNotJoined);
  const Pose2 T_map_fragment{5.0, -3.0, 1.0};
  const RobotGrid before = robot.Adopt(9, robot.Corrected(T_map_fragment, 0.0));
  ASSERT_FALSE(robot.record.joining().fragment);
  robot.ExpectAnswersOnPath();
  const PathPose joined = *robot.path().At(early);
  EXPECT_TRUE(joined.localized);
  EXPECT_EQ(joined.reason, PoseReason::kTracking);
  EXPECT_LT(Between(T_map_fragment * alone.T_map_robot, joined.T_map_robot).translation().norm(), kPastCellM);
  robot.Adopt(10, RobotGrid(before));
  const PathPose again = *robot.path().At(early);
  EXPECT_FALSE(again.localized);
  EXPECT_EQ(again.reason, PoseReason::kNotJoined);
  EXPECT_LT(Between(alone.T_map_robot, again.T_map_robot).translation().norm(), kPastCellM);
}

TEST(PastPoses, AfterARefusedStartNoneIsLocalized) {
  MappingRobot robot;
  robot.Drive(0, 20);
  EXPECT_TRUE(robot.Poses().back().localized);
  robot.estimator.Handle(StartRefused{"it is elsewhere"});
  for (const PathPose& pose : robot.Poses()) EXPECT_EQ(pose.reason, PoseReason::kNotJoined);
}

// A job that has found the place of a robot may be wrong, whatever was said of its start before.
TEST(PastPoses, ARefusedStartIsNoToldOneWhenTheRobotIsJoined) {
  MappingRobot robot;
  robot.Drive(0, 20);
  EXPECT_TRUE(robot.Material().start_known);
  EXPECT_FALSE(robot.Material().start_found);
  robot.estimator.Handle(StartRefused{"it is elsewhere"});
  EXPECT_FALSE(robot.Material().start_known);
  EXPECT_EQ(robot.record.joining().why, "it is elsewhere");
  const RobotGrid alone = robot.Adopt(9, robot.Corrected({5.0, -3.0, 1.0}, 0.0));
  EXPECT_TRUE(robot.Material().start_known);
  EXPECT_TRUE(robot.Material().start_found);
  EXPECT_EQ(robot.record.joining().why, "");
  robot.Adopt(10, RobotGrid(alone));
  EXPECT_FALSE(robot.Material().start_known);
  EXPECT_EQ(robot.record.joining().why, "it is elsewhere");
}

}  // namespace
}  // namespace cairn::server
