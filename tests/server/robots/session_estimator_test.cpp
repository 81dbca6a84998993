#include "server/robots/session_estimator.h"

#include <gtest/gtest.h>

#include "tests/server/robots/one_session.h"

namespace cairn::server {
namespace {

using testing::Dropped;
using testing::kOwner;
using testing::kScans;
using testing::OdometryOf;
using testing::RequestOf;
using testing::RoomOdometry;
using testing::RoomScan;
using testing::ScanOf;

class SessionEstimatorTest : public ::testing::Test {
 protected:
  SessionEstimatorTest() { EXPECT_TRUE(record_.AddSensors({"laser"})); }

  static EstimatorSetup FewParticles() {
    EstimatorSetup setup;
    setup.mapper.filter.particles = 20;
    return setup;
  }
  void HandleScan(Scan scan, ClientId client = kOwner) {
    record_.ScanReceived({HashName("r1"), HashName("laser"), client}, scan.sequence);
    estimator_.Handle(ScanOf("r1", std::move(scan), client));
  }
  void Drive(int first, int last) {
    for (int step = first; step < last; ++step) {
      EXPECT_TRUE(record_.OdometryReceived(kOwner, RoomOdometry(step).sequence));
      estimator_.Handle(OdometryOf("r1", RoomOdometry(step)));
      HandleScan(RoomScan(step));
    }
  }
  SessionMaterial Snapshot() {
    SessionMaterial taken;
    estimator_.Handle(SnapshotWanted{[&taken](SessionMaterial&& material) { taken = std::move(material); }});
    return taken;
  }
  Ledger ledger() const { return record_.snapshot().status.ledgers.at(0); }

  std::vector<PoseReport> poses_;
  std::vector<GridChange> changes_;
  SessionRecord record_{4, RequestOf("r1"), RobotsOptions{}};
  SessionEstimator estimator_{FewParticles(),
                              record_,
                              {.send =
                                   [this](OutboundValue value) {
                                     poses_.push_back(std::get<PoseReport>(std::move(value)));
                                     return true;
                                   },
                               .grid_changed = [this](GridChange&& change) { changes_.push_back(std::move(change)); }}};
};

// The beams follow one another while the robot drives: another scan is estimated than the one that came.
TEST_F(SessionEstimatorTest, ARollingScanIsUsedAsSoonAsItsLastBeamHasOdometry) {
  for (int step = 0; step < 6; ++step) {
    EXPECT_TRUE(record_.OdometryReceived(kOwner, RoomOdometry(step).sequence));
    estimator_.Handle(OdometryOf("r1", RoomOdometry(step)));
    Scan scan = RoomScan(step);
    scan.beam_period_s = 0.01 / static_cast<double>(scan.ranges_m.size());
    HandleScan(std::move(scan));
  }
  EXPECT_EQ(poses_.size(), 5U);
  EXPECT_EQ(ledger().used, 5U);
  EXPECT_EQ(ledger().waiting, 1U);
}

TEST_F(SessionEstimatorTest, EveryKeyframeChangesTheMapAndEveryScanGivesAPose) {
  Drive(0, 20);
  EXPECT_EQ(poses_.size(), 20U);
  EXPECT_EQ(ledger().used, 20U);
  EXPECT_EQ(changes_.size(), ledger().keyframes);
  EXPECT_GT(changes_.size(), 1U);
  for (const GridChange& change : changes_) EXPECT_EQ(change.session, 4U);
}

TEST_F(SessionEstimatorTest, TheLandmarksAreThoseOfTheEndWhateverTheirPeriod) {
  Drive(0, 80);
  estimator_.Handle(Finish{.final = false, .done = {}});
  ASSERT_FALSE(record_.snapshot().landmarks->empty());
  EXPECT_EQ(record_.snapshot().landmarks->front().robot, "r1");
}

// Nobody knows where a fragment is in the map, however well it knows its own surroundings.
TEST_F(SessionEstimatorTest, AFragmentIsNotLocalizedUntilAVersionJoinsIt) {
  EstimatorSetup setup = FewParticles();
  setup.fragment = true;
  std::vector<PoseReport> poses;
  SessionRecord record{5, RequestOf("r1"), RobotsOptions{}};
  ASSERT_TRUE(record.AddSensors({"laser"}));
  const auto keep = [&](OutboundValue value) {
    poses.push_back(std::get<PoseReport>(std::move(value)));
    return true;
  };
  SessionEstimator estimator{setup, record, {.send = keep, .grid_changed = [](GridChange&&) {}}};
  const auto drive = [&](int first, int last) {
    for (int step = first; step < last; ++step) {
      EXPECT_TRUE(record.OdometryReceived(kOwner, RoomOdometry(step).sequence));
      estimator.Handle(OdometryOf("r1", RoomOdometry(step)));
      record.ScanReceived(kScans, RoomScan(step).sequence);
      estimator.Handle(ScanOf("r1", RoomScan(step)));
    }
  };
  drive(0, 40);
  for (const PoseReport& pose : poses) {
    EXPECT_FALSE(pose.localized);
    EXPECT_EQ(pose.reason, PoseReason::kNotJoined);
  }
  EXPECT_TRUE(record.joining().fragment);
  EXPECT_GT(record.joining().driven_m, 0.5);
  estimator.Handle(Finish{.final = false, .done = {}});
  EXPECT_TRUE(record.snapshot().landmarks == nullptr || record.snapshot().landmarks->empty());

  RobotGrid displaced;
  const auto adopt = [&](RobotGrid grid) {
    estimator.Handle(Correction{.epoch = 1,
                                .generation = 1,
                                .grid = std::move(grid),
                                .done = [&](Adopted&& adopted) { displaced = std::move(adopted.displaced); },
                                .completed = std::make_shared<std::atomic<bool>>(true)});
  };
  // Without its path in the map it does not know where it is there.
  adopt({.chunks = {}, .keyframes = 1});
  drive(40, 42);
  EXPECT_EQ(poses.back().reason, PoseReason::kNotJoined);
  adopt({.chunks = {}, .keyframes = 1, .path = std::make_shared<const std::vector<Pose2>>(1, Pose2{1.0, 0.0, 0.0})});
  EXPECT_TRUE(displaced.fragment);
  EXPECT_FALSE(record.joining().fragment);
  drive(42, 45);
  EXPECT_TRUE(poses.back().localized);
  adopt(RobotGrid(displaced));
  EXPECT_FALSE(displaced.fragment);
  EXPECT_EQ(record.joining().driven_m, 0.0);  // No job joins it again at once.
  drive(45, 50);
  EXPECT_EQ(poses.back().reason, PoseReason::kNotJoined);
}

TEST_F(SessionEstimatorTest, ASnapshotNamesItsSessionAndHoldsWhatWasUsed) {
  Drive(0, 20);
  const SessionMaterial material = Snapshot();
  EXPECT_EQ(material.session, 4U);
  EXPECT_EQ(material.robot, "r1");
  EXPECT_EQ(material.snapshot.keyframes.size(), ledger().keyframes);
  EXPECT_EQ(material.snapshot.scans.size(), 20U);
}

TEST_F(SessionEstimatorTest, OdometryWithABadStampIsCounted) {
  Drive(0, 3);
  estimator_.Handle(OdometryOf("r1", RoomOdometry(1)));
  EXPECT_EQ(ledger().odometry_dropped, 1U);
}

// The scan that waits for odometry when the session ends is used with the last there was; after it nothing is used.
TEST_F(SessionEstimatorTest, TheEndSettlesWhatWaitsAndNothingIsUsedAfterIt) {
  Drive(0, 5);
  Scan late = RoomScan(5);
  late.stamp -= testing::kScanPeriod / 2;
  HandleScan(late);
  EXPECT_EQ(ledger().waiting, 1U);
  bool done = false;
  estimator_.Handle(Finish{.final = true, .done = [&done] { done = true; }});
  EXPECT_TRUE(done);
  EXPECT_EQ(ledger().used, 6U);
  HandleScan(RoomScan(7));
  estimator_.Handle(OdometryOf("r1", RoomOdometry(7)));
  EXPECT_EQ(Dropped(ledger(), DropReason::kSessionEnded), 1U);
  EXPECT_EQ(ledger().odometry_dropped, 1U);
  EXPECT_EQ(ledger().waiting, 0U);
  EXPECT_EQ(Snapshot().snapshot.scans.size(), 6U);  // Its part of the map can still be smoothed.
}

TEST_F(SessionEstimatorTest, ASuspensionIsNoEnd) {
  Drive(0, 5);
  estimator_.Handle(Finish{.final = false, .done = {}});
  Drive(5, 8);
  EXPECT_EQ(ledger().used, 8U);
}

TEST_F(SessionEstimatorTest, ACorrectionReplacesTheGridAndTellsWhatItGaveUp) {
  Drive(0, 10);
  const std::size_t keyframes = ledger().keyframes;
  RobotGrid smoothed;
  smoothed.keyframes = keyframes;
  smoothed.chunks.emplace(slam::ChunkKey{50, 50}, std::make_shared<const slam::GridChunk>());
  std::optional<Adopted> adopted;
  estimator_.Handle(
      Correction{.epoch = 9, .grid = smoothed, .done = [&adopted](Adopted&& answer) { adopted = std::move(answer); }});
  ASSERT_TRUE(adopted);
  EXPECT_EQ(adopted->session, 4U);
  EXPECT_EQ(adopted->displaced.keyframes, keyframes);
  EXPECT_FALSE(adopted->displaced.chunks.contains({50, 50}));
  // Every chunk of both: what only the old grid had is gone.
  EXPECT_EQ(adopted->change.chunks.size(), adopted->displaced.chunks.size() + 1);
  for (const auto& [key, chunk] : adopted->change.chunks) EXPECT_EQ(chunk != nullptr, key == (slam::ChunkKey{50, 50}));
  EXPECT_EQ(record_.epoch(), 9U);
  Drive(10, 11);
  EXPECT_EQ(poses_.back().map_epoch, 9U);
}

TEST_F(SessionEstimatorTest, AnotherEpochAloneChangesNothingElse) {
  Drive(0, 10);
  const Pose2 before = poses_.back().T_map_robot;
  const std::size_t chunks = Snapshot().snapshot.full_path.size();
  estimator_.Handle(EpochChange{9});
  EXPECT_EQ(record_.epoch(), 9U);
  EXPECT_EQ(Snapshot().snapshot.full_path.size(), chunks);
  Drive(10, 11);
  EXPECT_EQ(poses_.back().map_epoch, 9U);
  EXPECT_LT((poses_.back().T_map_robot.translation() - before.translation()).norm(), 0.5);
}

// The pose after a switch lies in the map of the new epoch, and a rollback takes it back.
TEST_F(SessionEstimatorTest, ACorrectionWithAPathMovesThePose) {
  Drive(0, 10);
  const std::size_t keyframes = ledger().keyframes;
  const Pose2 before = poses_.back().T_map_robot, T_new_old{2.0, 1.0, 0.3};
  std::vector<Pose2> path = Snapshot().snapshot.full_path;
  for (Pose2& pose : path) pose = T_new_old * pose;
  std::optional<Adopted> adopted;
  const auto adopt = [&](std::uint32_t epoch, RobotGrid grid) {
    estimator_.Handle(Correction{.epoch = epoch, .grid = std::move(grid), .done = [&adopted](Adopted&& answer) {
                                   adopted = std::move(answer);
                                 }});
  };
  adopt(9, {{}, keyframes, std::make_shared<const std::vector<Pose2>>(path)});
  Drive(10, 11);
  EXPECT_EQ(poses_.back().map_epoch, 9U);
  EXPECT_LT((poses_.back().T_map_robot.translation() - (T_new_old * before).translation()).norm(), 0.5);
  ASSERT_TRUE(adopted && adopted->displaced.path);
  EXPECT_EQ(adopted->displaced.path->size(), adopted->displaced.keyframes);
  ASSERT_TRUE(adopted->displaced.numbers);
  EXPECT_EQ(*adopted->displaced.numbers, Snapshot().snapshot.numbers);
  adopt(10, RobotGrid(adopted->displaced));
  Drive(11, 12);
  EXPECT_LT((poses_.back().T_map_robot.translation() - before.translation()).norm(), 0.5);
}

// A session that was not stored to its end adopts its part of a map that was drawn when it had gone farther.
TEST_F(SessionEstimatorTest, WhoIsBehindTheMapThatItAdoptsFollowsItsPath) {
  Drive(0, 10);
  const Pose2 before = poses_.back().T_map_robot, T_new_old{2.0, 1.0, 0.3};
  std::vector<Pose2> path = Snapshot().snapshot.full_path;
  for (Pose2& pose : path) pose = T_new_old * pose;
  for (int more = 0; more < 3; ++more) path.push_back(path.back() * Pose2{0.3, 0.0, 0.0});
  std::optional<Adopted> adopted;
  estimator_.Handle(Correction{.epoch = 9,
                               .grid = {{}, path.size(), std::make_shared<const std::vector<Pose2>>(path)},
                               .done = [&adopted](Adopted&& answer) { adopted = std::move(answer); }});
  Drive(10, 11);
  EXPECT_LT((poses_.back().T_map_robot.translation() - (T_new_old * before).translation()).norm(), 0.5);
  EXPECT_FALSE(adopted->fragment);
}

// Its poses would be those of the map before, whatever it sees.
TEST_F(SessionEstimatorTest, WhoCannotFollowTheMapThatItAdoptsIsNotLocalized) {
  Drive(0, 10);
  ASSERT_TRUE(poses_.back().localized);
  std::optional<Adopted> adopted;
  estimator_.Handle(Correction{.epoch = 9,
                               .grid = {.chunks = {}, .keyframes = ledger().keyframes + 5},
                               .done = [&adopted](Adopted&& answer) { adopted = std::move(answer); }});
  EXPECT_TRUE(adopted->fragment);
  Drive(10, 260);  // Around the box: it sees its own places again.
  for (std::size_t i = 10; i < poses_.size(); ++i) EXPECT_FALSE(poses_[i].localized) << i;
  EXPECT_EQ(poses_.back().map_epoch, 9U);
}

// The next server would have this robot's part of a map that was never switched, beside the old parts of the others.
TEST_F(SessionEstimatorTest, NoCheckpointHoldsAGridBeforeTheSwitchToItIsComplete) {
  Drive(0, 10);
  ASSERT_TRUE(estimator_.Save());
  const auto completed = std::make_shared<std::atomic<bool>>(false);
  estimator_.Handle(Correction{.epoch = 9, .grid = {}, .done = [](Adopted&&) {}, .completed = completed});
  EXPECT_FALSE(estimator_.Save());
  *completed = true;
  EXPECT_TRUE(estimator_.Save());
}

// The clock of a robot was set back by an hour: its scans are accepted again after a few of them, its poses carry its
// own stamps, and the path goes on growing.
TEST_F(SessionEstimatorTest, AClockThatIsSetBackCostsAFewScans) {
  Drive(0, 10);
  for (int step = 10; step < 40; ++step) {
    Odometry odometry = RoomOdometry(step);
    Scan scan = RoomScan(step);
    odometry.stamp -= 3600 * kNanosPerSecond;
    scan.stamp -= 3600 * kNanosPerSecond;
    estimator_.Handle(OdometryOf("r1", odometry));
    HandleScan(std::move(scan));
  }
  EXPECT_GE(ledger().used, 34U);
  EXPECT_GE(Dropped(ledger(), DropReason::kStampWentBack), 1U);
  EXPECT_EQ(ledger().received, 40U);
  EXPECT_EQ(ledger().waiting, 0U);
  EXPECT_EQ(poses_.back().stamp, RoomScan(39).stamp - 3600 * kNanosPerSecond);
  EXPECT_EQ(record_.snapshot().path.size(), ledger().used);
  EXPECT_LT(Between(testing::TruePose(39), poses_.back().T_map_robot).translation().norm(), 0.1);
}

// A robot's computer was started again: its new client numbers from 1, and its clock is an hour behind. Scans with
// small numbers were taken for late ones, and none was used until the numbers had caught up.
TEST_F(SessionEstimatorTest, ANewClientMayNumberFromTheBeginningWithAnEarlierClock) {
  constexpr ClientId kRestarted = 9;
  constexpr int kBefore = 30, kAfter = 20;
  Drive(0, kBefore);
  ASSERT_TRUE(record_.Resume(kRestarted, 1));
  for (int step = kBefore; step < kBefore + kAfter; ++step) {
    Odometry odometry = RoomOdometry(step);
    Scan scan = RoomScan(step);
    odometry.stamp -= 3600 * kNanosPerSecond;
    scan.stamp -= 3600 * kNanosPerSecond;
    odometry.sequence = scan.sequence = static_cast<std::uint64_t>(step - kBefore) + 1;
    estimator_.Handle(OdometryOf("r1", odometry, kRestarted));
    HandleScan(std::move(scan), kRestarted);
  }
  // The clock that went back is believed after slam.pairing.jump_confirmations samples of each stream.
  EXPECT_GE(ledger().used, kBefore + kAfter - 6U);
}

// Scans wait in the estimator for their odometry, and others in the queue for the estimator. The first are in the
// checkpoint, the second are not: they come again.
TEST_F(SessionEstimatorTest, ACheckpointHoldsWhatWaitsInTheEstimatorAndNotWhatWaitsInTheQueue) {
  Drive(0, 20);
  for (int step = 20; step < 23; ++step) HandleScan(RoomScan(step));
  for (std::uint64_t sequence = 24; sequence <= 26; ++sequence)
    EXPECT_EQ(record_.ScanReceived(kScans, sequence), SessionRecord::Arrival::kNew);
  EXPECT_EQ(ledger().waiting, 6U);
  const auto save = estimator_.Save();
  ASSERT_TRUE(save);
  const CheckpointContent content = save();

  std::vector<PoseReport> poses;
  SessionRecord record(4, RequestOf("r1"), RobotsOptions{});
  SessionEstimator other{FewParticles(),
                         record,
                         {.send =
                              [&poses](OutboundValue value) {
                                poses.push_back(std::get<PoseReport>(std::move(value)));
                                return true;
                              },
                          .grid_changed = [](GridChange&&) {}}};
  std::vector<std::string> pieces;
  for (const CheckpointPiece& piece : content.pieces) pieces.push_back(piece.bytes());
  const std::vector<std::string_view> views(pieces.begin(), pieces.end());
  const auto loaded = other.Load(content.main, views);
  ASSERT_TRUE(loaded);
  // The next checkpoint shares what has not changed.
  ASSERT_EQ(loaded->size(), pieces.size());
  const CheckpointContent again = other.Save()();
  EXPECT_TRUE(std::ranges::any_of(again.pieces, [&](const CheckpointPiece& piece) {
    return std::ranges::find(*loaded, piece.value) != loaded->end();
  }));
  const auto restored = [&record] { return record.snapshot().status.ledgers.at(0); };
  EXPECT_EQ(restored().received, 23U);
  EXPECT_EQ(restored().waiting, 3U);
  for (int step = 20; step < 26; ++step) {
    if (step >= 23) {
      EXPECT_EQ(record.ScanReceived(kScans, RoomScan(step).sequence), SessionRecord::Arrival::kNew);
      other.Handle(ScanOf("r1", RoomScan(step)));
      estimator_.Handle(ScanOf("r1", RoomScan(step)));
    }
    EXPECT_TRUE(record.OdometryReceived(kOwner, RoomOdometry(step).sequence));
    EXPECT_TRUE(record_.OdometryReceived(kOwner, RoomOdometry(step).sequence));
    other.Handle(OdometryOf("r1", RoomOdometry(step)));
    estimator_.Handle(OdometryOf("r1", RoomOdometry(step)));
  }
  EXPECT_EQ(restored().used, 26U);
  EXPECT_EQ(restored().waiting, 0U);
  ASSERT_EQ(poses.size(), 6U);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(poses[i].T_map_robot, poses_[20 + i].T_map_robot);
    EXPECT_EQ(poses[i].scan_sequence, poses_[20 + i].scan_sequence);
  }
}

TEST_F(SessionEstimatorTest, DiscardAnswersWithoutTheEstimator) {
  Drive(0, 3);
  record_.ScanReceived(kScans, 4);
  estimator_.Discard(ScanOf("r1", RoomScan(3)));
  estimator_.Discard(OdometryOf("r1", RoomOdometry(3)));
  bool done = false;
  estimator_.Discard(Finish{.final = true, .done = [&done] { done = true; }});
  estimator_.Discard(Finish{});
  EXPECT_TRUE(done);
  SessionMaterial material;
  estimator_.Discard(SnapshotWanted{[&material](SessionMaterial&& answer) { material = std::move(answer); }});
  EXPECT_EQ(material.session, 4U);
  EXPECT_TRUE(material.snapshot.keyframes.empty());
  EXPECT_EQ(Dropped(ledger(), DropReason::kSessionEnded), 1U);
  EXPECT_EQ(ledger().odometry_dropped, 1U);
  EXPECT_EQ(ledger().used, 3U);
}

}  // namespace
}  // namespace cairn::server
