// What the end of a session does to its robot's path and map, and that a server that is killed at any moment of it
// comes to the same.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "common/file/number_bytes.h"
#include "tests/server/robots/one_session.h"

namespace cairn::server::testing {
namespace {

constexpr double kCellM = 0.05;
constexpr int kSteps = 500;  // Round the room and on, so that it often sees again what it saw first.

// Its wheels slip: without what it sees again, its path would be wrong.
Odometry SlippingOdometry(int step) {
  Odometry odometry = RoomOdometry(step);
  odometry.T_odom_robot = Pose2{0.0, 0.0, 0.0005 * step} * odometry.T_odom_robot;
  return odometry;
}

// What the estimator of one server gave.
struct Given {
  std::vector<JournalEntry> journal;
  std::vector<PoseReport> poses;
  std::vector<GridChange> changes;
};

EstimatorSetup FewParticles() {
  EstimatorSetup setup;
  setup.mapper.filter.particles = 20;
  return setup;
}

struct EndingRobot {
  EndingRobot()
      : estimator(FewParticles(), record,
                  {.send =
                       [this](const OutboundValue& value) {
                         if (const auto* pose = std::get_if<PoseReport>(&value)) given.poses.push_back(*pose);
                         return true;
                       },
                   .grid_changed = [this](GridChange&& change) { given.changes.push_back(std::move(change)); },
                   .store =
                       [this](JournalEntry entry) {
                         given.journal.push_back(std::move(entry));
                         return true;
                       }}) {
    EXPECT_TRUE(record.AddSensors({"laser"}));
  }

  void Take(int step) {
    const Odometry odometry = SlippingOdometry(step);
    EXPECT_TRUE(record.OdometryReceived(kOwner, odometry.sequence));
    estimator.Handle(OdometryOf("r1", odometry));
    Scan scan = RoomScan(step);
    record.ScanReceived(kScans, scan.sequence);
    estimator.Handle(ScanOf("r1", std::move(scan)));
  }
  void Drive(int first, int last) {
    for (int step = first; step < last; ++step) Take(step);
  }
  void End() {
    Finish finish;
    finish.done = [this] { static_cast<void>(record.SetPhase(SessionPhase::kEnded, {})); };
    estimator.Handle(std::move(finish));
  }
  void DrawToTheEnd() {
    while (estimator.DrawLate()) {
    }
  }
  void Adopt(std::uint32_t epoch, RobotGrid grid) {
    estimator.Handle(Correction{.epoch = epoch,
                                .generation = epoch,
                                .grid = std::move(grid),
                                .done = [](Adopted&&) {},
                                .completed = std::make_shared<std::atomic<bool>>(true)});
  }
  [[nodiscard]] slam::MapperSnapshot Snapshot() {
    slam::MapperSnapshot snapshot;
    estimator.Handle(
        SnapshotWanted{[&snapshot](SessionMaterial&& material) { snapshot = std::move(material.snapshot); }});
    return snapshot;
  }
  // The same map with its robot's path turned, as a job might have found it.
  [[nodiscard]] RobotGrid Turned() {
    std::vector<Pose2> path = Snapshot().full_path;
    for (Pose2& pose : path) pose = Pose2{1.0, 2.0, 0.3} * pose;
    const std::uint64_t keyframes = path.size();
    return {.chunks = {}, .keyframes = keyframes, .path = std::make_shared<const std::vector<Pose2>>(std::move(path))};
  }
  // A checkpoint: its main part, the estimator's part of that, and the pieces. Empty where none can be made.
  [[nodiscard]] std::vector<std::string> State() const {
    std::vector<std::string> state;
    const auto save = estimator.Save();
    if (!save) return state;
    const CheckpointContent content = save();
    state.push_back(content.main);
    std::string_view main = content.main;
    const auto own = TakeNumber<std::uint64_t>(main);
    EXPECT_TRUE(own && *own < main.size());
    state.emplace_back(main.substr(own.value_or(0)));
    for (const CheckpointPiece& piece : content.pieces) state.push_back(piece.bytes());
    return state;
  }
  // Goes on as the next server does after a kill: from a checkpoint (none: from the beginning), and the journal from
  // `first` on and before `end`.
  void Restart(const std::vector<std::string>& checkpoint, const std::vector<JournalEntry>& journal, std::size_t first,
               std::size_t end) {
    if (!checkpoint.empty()) {
      const std::vector<std::string_view> pieces(checkpoint.begin() + 2, checkpoint.end());
      ASSERT_TRUE(estimator.Load(checkpoint.front(), pieces));
    }
    for (std::size_t i = first; i < end; ++i)
      estimator.Replay(JournalEntry(journal[i]), [](std::uint32_t, std::uint64_t) { return true; });
    estimator.Replayed();
    record.Restored(0);
  }

  Given given;
  SessionRecord record{4, RequestOf("r1"), RobotsOptions{}};
  SessionEstimator estimator;
};

std::vector<PathPose> PastPosesOf(const EndingRobot& robot) {
  const PathView view = robot.record.snapshot().path;
  std::vector<PathPose> poses;
  for (std::size_t i = 0; i < view.blocks(); ++i) poses.insert(poses.end(), view.block(i).begin(), view.block(i).end());
  return poses;
}

// The session's own main part is left out: the way that counts until a job may join a robot lacks a step after a
// restart.
void ExpectSame(const EndingRobot& one, const EndingRobot& other) {
  const std::vector<PathPose> here = PastPosesOf(one), there = PastPosesOf(other);
  ASSERT_EQ(here.size(), there.size());
  for (std::size_t i = 0; i < here.size(); ++i) ASSERT_EQ(here[i].T_map_robot, there[i].T_map_robot) << i;
  EXPECT_EQ(one.record.snapshot().status.pose.T_map_robot, other.record.snapshot().status.pose.T_map_robot);
  const std::vector<std::string> state = one.State(), other_state = other.State();
  ASSERT_EQ(state.size(), other_state.size());
  EXPECT_TRUE(std::equal(state.begin() + 1, state.end(), other_state.begin() + 1));
}

double MostApart(const std::vector<Pose2>& a, const std::vector<Pose2>& b) {
  EXPECT_EQ(a.size(), b.size());
  double most_m = 0.0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k)
    most_m = std::max(most_m, (a[k].translation() - b[k].translation()).norm());
  return most_m;
}

TEST(SessionEnd, ThePathFitsAllThatWasSeenAgainAndPoseAndMapFollow) {
  EndingRobot robot;
  robot.Drive(0, kSteps);
  const slam::MapperSnapshot before = robot.Snapshot();
  const Pose2 last = robot.given.poses.back().T_map_robot;
  robot.End();
  const slam::MapperSnapshot fitted = robot.Snapshot();
  ASSERT_GT(MostApart(before.full_path, fitted.full_path), 0.002) << "the path must need it";
  const Pose2 T_new_old = fitted.full_path.back() * before.full_path.back().Inverse();
  const PoseReport told = robot.given.poses.back();
  EXPECT_LT((told.T_map_robot.translation() - (T_new_old * last).translation()).norm(), 1e-9);
  EXPECT_EQ(told.T_map_robot, robot.record.snapshot().status.pose.T_map_robot);
  EXPECT_EQ(told.scan_sequence, std::uint64_t{kSteps});
  const Trajectory along = fitted.FullTrajectory();
  const std::vector<PathPose> past = PastPosesOf(robot);
  ASSERT_EQ(along.size(), past.size());
  for (std::size_t i = 0; i < along.size(); ++i)
    EXPECT_LT((along[i].T_map_robot.translation() - past[i].T_map_robot.translation()).norm(), kCellM) << i;
  // Other robots have their turns while it is drawn again.
  ASSERT_GT(fitted.keyframes.size(), 40U);
  EXPECT_FALSE(robot.estimator.Save()) << "the next server would not draw the rest";
  EXPECT_TRUE(robot.estimator.DrawLate());
  EXPECT_TRUE(robot.estimator.DrawLate());
  robot.DrawToTheEnd();
  const slam::MapperSnapshot drawn = robot.Snapshot();
  EXPECT_EQ(drawn.online_path, drawn.full_path);
  ASSERT_FALSE(robot.given.changes.empty());
  EXPECT_EQ(*robot.given.changes.back().drawn.path, drawn.full_path);
  // Once only.
  robot.End();
  EXPECT_EQ(robot.Snapshot().full_path, fitted.full_path);
}

// Every server that reads it comes to the same, wherever the one before was killed: before the end, between the end and
// the drawing of its map, and after that; with the last checkpoint from any time before, or from after the end.
TEST(SessionEnd, AKillAtAnyMomentOfItChangesNothing) {
  EndingRobot whole;
  std::vector<std::pair<std::size_t, std::vector<std::string>>> checkpoints = {{0, {}}};
  const auto save = [&] {
    if (auto state = whole.State(); !state.empty())
      checkpoints.emplace_back(whole.given.journal.size(), std::move(state));
  };
  for (int step = 0; step < kSteps; ++step) {
    whole.Take(step);
    if (step % 100 == 99 || step > kSteps - 4) save();
  }
  const std::size_t before_end = whole.given.journal.size();
  whole.End();
  const std::size_t end = whole.given.journal.size();
  ASSERT_EQ(end, before_end + 1);
  whole.DrawToTheEnd();
  save();
  ASSERT_EQ(checkpoints.back().first, end);
  for (const auto& [position, checkpoint] : checkpoints) {
    SCOPED_TRACE("checkpoint after " + std::to_string(position) + " entries");
    EndingRobot after;
    after.Restart(checkpoint, whole.given.journal, position, end);
    ExpectSame(whole, after);
    if (position > before_end) continue;
    EndingRobot before;  // The client asks for the end once more.
    before.Restart(checkpoint, whole.given.journal, position, before_end);
    before.End();
    before.DrawToTheEnd();
    ExpectSame(whole, before);
  }
}

// Somebody switches the map while the robot's part of it is still being drawn again: to one that a job has found, which
// the path follows, or to an old one that says nothing of the path.
TEST(SessionEnd, AMapThatComesBeforeTheLastIsDrawnIsTheSameAfterARestart) {
  for (const bool follows : {true, false}) {
    SCOPED_TRACE(follows);
    EndingRobot whole;
    whole.Drive(0, kSteps);
    RobotGrid other = whole.Turned();  // From before the end.
    if (!follows) other.path = nullptr;
    whole.End();
    ASSERT_TRUE(whole.estimator.DrawLate());
    whole.Adopt(5, RobotGrid(other));
    EXPECT_EQ(whole.record.epoch(), 5U);
    whole.DrawToTheEnd();
    EndingRobot after;
    after.Restart({}, whole.given.journal, 0, whole.given.journal.size());
    ExpectSame(whole, after);
    const slam::MapperSnapshot drawn = whole.Snapshot();
    EXPECT_EQ(drawn.online_path, drawn.full_path);
  }
}

}  // namespace
}  // namespace cairn::server::testing
