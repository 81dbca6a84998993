// A server that was killed and started again on its store, without DDS. The kill is a copy of the store's files at a
// moment when the server did not expect it: what a SIGKILL leaves.
#include <gmock/gmock.h>

#include <filesystem>
#include <map>

#include "server/store/site_contents.h"
#include "server/store/sqlite_store.h"
#include "tests/eventually.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

constexpr int kSteps = 120;

// The same room without a kill.
const Trajectory& UndisturbedPath() {
  static const Trajectory path = [] {
    WholeServer house;
    house.Open("r1", kDriver);
    house.Drive("r1", kDriver, 0, kSteps);
    return PathOf(house);
  }();
  return path;
}

// What the robot's client does when it meets a new server: says that it was there before, and sends again what is not
// durable.
void GoOn(WholeServer& house, int from, int to) {
  SayStarted(house);
  ASSERT_TRUE(house.WaitPhase("r1", kDriver, SessionPhase::kActive));
  house.Drive("r1", kDriver, from, to);
}

TEST(Restore, AKilledServerGoesOnWithTheSamePathToTheLastBit) {
  const TempDirectory directory;
  int kills = 0;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    ASSERT_TRUE(first->WaitPhase("r1", kDriver, SessionPhase::kActive));
    for (int step = 0; step < 70; step += 14) {
      first->Drive("r1", kDriver, step, step + 14);
      CopyState(directory / "0", directory / std::to_string(++kills));
    }
  }
  for (int kill = 1; kill <= kills; ++kill) {
    StoredServer second(directory / std::to_string(kill));
    const Reply before = second->Ask(About(RequestKind::kStatus));
    ASSERT_EQ(before.robots.size(), 1U) << kill;
    EXPECT_EQ(before.robots[0].session.phase, SessionPhase::kSuspended);
    EXPECT_TRUE(before.robots[0].session.durable);
    const Ledger& ledger = before.robots[0].ledgers[0];
    EXPECT_EQ(ledger.received, ledger.durable_through);
    EXPECT_EQ(ledger.used + ledger.waiting, ledger.durable_through);
    EXPECT_LE(ledger.durable_through, static_cast<std::uint64_t>(14 * kill));
    // Everything that lies beyond what is durable comes again; and some of what does not, which is ignored.
    GoOn(*second.operator->(), std::max(0, static_cast<int>(ledger.durable_through) - 3), kSteps);
    EXPECT_TRUE(SamePath(PathOf(*second.operator->()), UndisturbedPath())) << kill;
    const Ledger after = second->LastLedger("r1");
    EXPECT_EQ(after.received, static_cast<std::uint64_t>(kSteps));
    EXPECT_EQ(after.used, static_cast<std::uint64_t>(kSteps));
    EXPECT_EQ(after.dropped_total(), 0U);
  }
}

// With checkpoints the journal before them is not needed any more: here it is not even there.
TEST(Restore, FromACheckpointThePathIsTheSameToTheLastBit) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  {
    StoredServer first(directory / "0", options);
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 90);
    ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 90; }));
  }
  {
    const auto store = *OpenStore(directory / "0");
    const auto checkpoint = ReadCheckpoint(*store, 1);
    ASSERT_TRUE(checkpoint && *checkpoint);
    EXPECT_GE((*checkpoint)->position, 40U);
    ASSERT_TRUE(store->Commit(
        {.removed = {{.kind = RecordKind::kJournal, .owner = 1, .first = 0, .last = (*checkpoint)->position}},
         .put = {}}));
  }
  StoredServer second(directory / "0", options);
  const Reply status = second->Ask(About(RequestKind::kStatus));
  ASSERT_EQ(status.robots.size(), 1U);
  ASSERT_EQ(status.robots[0].ledgers.size(), 1U);
  EXPECT_EQ(status.robots[0].ledgers[0].received, 90U);
  EXPECT_EQ(status.robots[0].ledgers[0].durable_through, 90U);
  GoOn(*second.operator->(), 90, kSteps);
  EXPECT_TRUE(SamePath(PathOf(*second.operator->()), UndisturbedPath()));
  const Ledger after = second->LastLedger("r1");
  EXPECT_EQ(after.received, static_cast<std::uint64_t>(kSteps));
  EXPECT_EQ(after.used, static_cast<std::uint64_t>(kSteps));
}

// What an ended session has drawn weighs less in the map. The next server must know which sessions have ended.
TEST(Restore, ASessionThatHasEndedIsThePastOfItsMap) {
  const TempDirectory directory;
  const auto past = [&directory] {
    const auto store = *OpenStore(directory.path());
    return ReadSite(*store, "lab")->site.past;
  };
  DriveTwoRobots(directory.path(), TestOptions());
  EXPECT_TRUE(past().empty());
  {
    StoredServer second(directory.path());
    second->Open("r2", kDriver);
    ASSERT_TRUE(second->WaitPhase("r2", kDriver, SessionPhase::kActive));
    second->End("r2", kDriver);
    ASSERT_TRUE(second->WaitPhase("r2", kDriver, SessionPhase::kEnded));
  }
  EXPECT_EQ(past(), std::vector<std::uint64_t>{2});
  // As if the last server was killed before the site was stored.
  {
    const auto store = *OpenStore(directory.path());
    StoredSite site = ReadSite(*store, "lab")->site;
    site.past.clear();
    ASSERT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kSite, HashName("lab"), 0}, BytesOf(site)}}}));
  }
  { const StoredServer third(directory.path()); }
  EXPECT_EQ(past(), std::vector<std::uint64_t>{2});
}

// Some scan always waits for its odometry, so that the session is never without a waiting sample.
TEST(Restore, ARobotWhoseOdometryLagsGetsCheckpointsToo) {
  constexpr int kLag = 3;
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  {
    StoredServer first(directory / "0", options);
    first->Open("r1", kDriver);
    // The last sample is a scan: when it is durable, all samples are.
    for (int step = 0; step < 90; ++step) {
      if (step >= kLag) first->SendOdometry("r1", kDriver, RoomOdometry(step - kLag));
      first->SendScan("r1", kDriver, RoomScan(step));
      if (step >= kLag && step % 8 == 0) first->WaitSettled("r1", static_cast<std::uint64_t>(step - kLag) + 1);
    }
    ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 90; }));
    CopyState(directory / "0", directory / "1");
  }
  {
    const auto store = *OpenStore(directory / "1");
    const auto checkpoint = ReadCheckpoint(*store, 1);
    ASSERT_TRUE(checkpoint && *checkpoint);
    ASSERT_TRUE(store->Commit(
        {.removed = {{.kind = RecordKind::kJournal, .owner = 1, .first = 0, .last = (*checkpoint)->position}},
         .put = {}}));
  }
  StoredServer second(directory / "1", options);
  const Reply status = second->Ask(About(RequestKind::kStatus));
  ASSERT_EQ(status.robots.size(), 1U);
  EXPECT_EQ(status.robots[0].ledgers[0].received, 90U);
  EXPECT_EQ(status.robots[0].ledgers[0].waiting, static_cast<std::uint64_t>(kLag));
  GoOn(*second.operator->(), 90 - kLag, kSteps);
  EXPECT_TRUE(SamePath(PathOf(*second.operator->()), UndisturbedPath()));
  const Ledger after = second->LastLedger("r1");
  EXPECT_EQ(after.received, static_cast<std::uint64_t>(kSteps));
  EXPECT_EQ(after.used, static_cast<std::uint64_t>(kSteps));
}

TEST(Restore, WhatIsDurableIsThereAfterAKillAndTheRestIsNotCountedTwice) {
  const TempDirectory directory;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 40);
    ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 40; }));
    CopyState(directory / "0", directory / "1");
  }
  StoredServer second(directory / "1");
  EXPECT_EQ(DurableScans(*second.operator->()), 40U);
  EXPECT_EQ(PathOf(*second.operator->()).size(), 40U);
}

// Each start began to count anew for how long a robot was away.
TEST(Restore, ForHowLongARobotIsAwayIsKeptOverRestarts) {
  const TempDirectory directory;
  const auto quiet_since = [&](const char* name) {
    const auto store = *OpenStore(directory / name);
    return ReadSessions(*store)->at(1).quiet_since_ms;
  };
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 20);
    EXPECT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 20; }));
    CopyState(directory / "0", directory / "driving");
    first->Push(ClientLiveliness{kDriver, HashName("r1"), false});
    ASSERT_TRUE(first->WaitPhase("r1", kDriver, SessionPhase::kSuspended));
    ASSERT_TRUE(test::Eventually([&] {
      std::filesystem::remove_all(directory / "now");
      CopyState(directory / "0", directory / "now");
      return quiet_since("now") > 0;
    }));
  }
  EXPECT_EQ(quiet_since("driving"), 0U);
  const std::uint64_t since_ms = quiet_since("0");
  EXPECT_GT(since_ms, 0U);
  for (int start = 0; start < 2; ++start) {
    StoredServer next(directory / "0");
    EXPECT_EQ(next->Ask(About(RequestKind::kStatus)).robots[0].session.phase, SessionPhase::kSuspended);
  }
  EXPECT_EQ(quiet_since("0"), since_ms);
}

TEST(Restore, TilesAreAnsweredBeforeTheRobotIsBack) {
  const TempDirectory directory;
  std::map<TileKey, TileCells> drawn;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 60);
    ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 60; }));
    CopyState(directory / "0", directory / "1");
    ASSERT_TRUE(first->WaitFor([&] { return first->CurrentTiles().size() >= 4; }));
  }
  {
    WholeServer undisturbed;
    undisturbed.Open("r1", kDriver);
    undisturbed.Drive("r1", kDriver, 0, 60);
    undisturbed.Stop();
    for (const auto& [key, tile] : undisturbed.CurrentTiles()) drawn[key] = *DecodeCells(tile.bytes, tile.encoding);
  }
  StoredServer second(directory / "1");
  // The map is as old as the checkpoint at first, and then follows the journal.
  EXPECT_TRUE(second->WaitFor([&] {
    std::map<TileKey, TileCells> now;
    for (const auto& [key, tile] : second->CurrentTiles()) now[key] = *DecodeCells(tile.bytes, tile.encoding);
    return now == drawn;
  }));
}

TEST(Restore, SamplesBeyondAGapWaitUntilTheMissingOnesWereSentAgainOrTheTimeIsUp) {
  const TempDirectory directory;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 20);
    ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 20; }));
    CopyState(directory / "0", directory / "1");
    CopyState(directory / "0", directory / "2");
  }
  {
    StoredServer second(directory / "1");
    GoOn(*second.operator->(), 20, 20);
    for (int step = 24; step < 28; ++step) {  // What the robot measures meanwhile.
      second->SendOdometry("r1", kDriver, RoomOdometry(step));
      second->SendScan("r1", kDriver, RoomScan(step));
    }
    second->Drive("r1", kDriver, 20, 40);
    const Ledger ledger = second->LastLedger("r1");
    EXPECT_EQ(ledger.received, 40U);
    EXPECT_EQ(ledger.used, 40U);
    EXPECT_EQ(ledger.dropped_total(), 0U);
  }
  ServerOptions options = TestOptions();
  options.robots.gap_wait_s = 0.1;
  StoredServer second(directory / "2", options);
  GoOn(*second.operator->(), 20, 20);
  ASSERT_TRUE(second->WaitFor([&] {
    second->SendOdometry("r1", kDriver, RoomOdometry(30));
    second->SendScan("r1", kDriver, RoomScan(30));
    return second->LastLedger("r1").received == 21;
  }));
  EXPECT_EQ(second->LastLedger("r1").dropped[static_cast<std::size_t>(DropReason::kLostOnWire)], 10U);
}

TEST(Restore, MapVersionsEpochsAndJobsAreAsBefore) {
  const TempDirectory directory;
  Reply before, smoothed;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 60);
    Request submit = About(RequestKind::kJobSubmit);
    const Reply reply = first->Ask(submit);
    ASSERT_EQ(reply.jobs.size(), 1U);
    ASSERT_EQ(first->WaitJob(reply.jobs[0].id).state, JobState::kSucceeded);
    first->Drive("r1", kDriver, 60, 80);
    ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 80; }));
    before = first->Ask(About(RequestKind::kMapInfo));
    Request path = About(RequestKind::kPath);
    path.smoothed = true;
    smoothed = first->Ask(path);
    CopyState(directory / "0", directory / "1");
  }
  ASSERT_EQ(before.maps.size(), 1U);
  ASSERT_EQ(before.maps[0].enabled_version, 2U);
  StoredServer second(directory / "1");
  const Reply after = second->Ask(About(RequestKind::kMapInfo));
  ASSERT_EQ(after.maps.size(), 1U);
  EXPECT_EQ(after.maps[0].epoch, before.maps[0].epoch);
  EXPECT_EQ(after.maps[0].enabled_version, 2U);
  ASSERT_EQ(after.maps[0].versions.size(), before.maps[0].versions.size());
  EXPECT_EQ(after.maps[0].versions[1].note, before.maps[0].versions[1].note);
  const Reply jobs = second->Ask(About(RequestKind::kJobList));
  ASSERT_EQ(jobs.jobs.size(), 1U);
  EXPECT_EQ(jobs.jobs[0].state, JobState::kSucceeded);
  EXPECT_EQ(jobs.jobs[0].map_version, 2U);
  Request path = About(RequestKind::kPath);
  path.smoothed = true;
  EXPECT_TRUE(SamePath(second->Ask(path).path, smoothed.path));
  EXPECT_EQ(second->Ask(About(RequestKind::kStatus)).robots[0].pose.map_epoch, before.maps[0].epoch);
  // The version that was enabled before can be enabled again.
  Request roll_back = About(RequestKind::kMapEnable);
  roll_back.map_version = 1;
  const Reply rolled = second->Ask(roll_back);
  EXPECT_TRUE(rolled.status.ok()) << rolled.status.message;
  EXPECT_EQ(second->Ask(About(RequestKind::kMapInfo)).maps[0].epoch, before.maps[0].epoch + 1);
}

TEST(Restore, TheMapOfAnEarlierSessionStaysAndSoDoesAnEndedOne) {
  const TempDirectory directory;
  std::size_t tiles = 0;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 60);
    first->End("r1", kDriver);
    ASSERT_TRUE(first->WaitPhase("r1", kDriver, SessionPhase::kEnded));
    first->Open("r1", kDriver);  // A new session, which has drawn nothing yet.
    ASSERT_TRUE(first->WaitPhase("r1", kDriver, SessionPhase::kActive));
    first->Open("r2", 9);
    first->End("r2", 9);
    ASSERT_TRUE(first->WaitPhase("r2", 9, SessionPhase::kEnded));
    first->Stop();
    tiles = first->CurrentTiles().size();
  }
  ASSERT_GE(tiles, 4U);
  StoredServer second(directory / "0");
  ASSERT_TRUE(second->WaitFor([&] { return second->CurrentTiles().size() == tiles; }))
      << second->CurrentTiles().size() << " of " << tiles;
  const Reply status = second->Ask(About(RequestKind::kStatus, ""));
  std::map<std::string, SessionPhase> phases;
  for (const RobotStatus& robot : status.robots) phases[robot.session.robot] = robot.session.phase;
  EXPECT_EQ(phases["r1"], SessionPhase::kSuspended);
  EXPECT_EQ(phases["r2"], SessionPhase::kEnded);
}

// A server that is stopped goes on like one that was killed.
TEST(Restore, AfterSigtermThePathIsTheSameToTheLastBitToo) {
  const TempDirectory directory;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 50);
  }
  StoredServer second(directory / "0");
  EXPECT_EQ(DurableScans(*second.operator->()), 50U);
  GoOn(*second.operator->(), 50, kSteps);
  EXPECT_TRUE(SamePath(PathOf(*second.operator->()), UndisturbedPath()));
}

}  // namespace
}  // namespace cairn::server::testing
