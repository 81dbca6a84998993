// The whole server behind its two channels, without DDS: the main job and its promises.
#include "server/server.h"

#include <gmock/gmock.h>

#include <map>
#include <vector>

#include "tests/server/support/whole_server.h"

namespace cairn::server::testing {
namespace {

constexpr ClientId kClient = 7;

Request Of(RequestKind kind) {
  Request request;
  request.kind = kind;
  request.site = "lab";
  request.robot = "r1";
  return request;
}

TEST(Server, AnswersAStreamWithPosesTheLedgerAndTiles) {
  WholeServer house;
  house.Open("r1", kClient);
  house.Drive("r1", kClient, 0, 60);
  const auto poses = house.All<PoseReport>();
  ASSERT_EQ(poses.size(), 60U);
  for (std::size_t i = 0; i < poses.size(); ++i) EXPECT_EQ(poses[i].scan_sequence, i + 1);
  const Pose2 error = Between(TruePose(59), poses.back().T_map_robot);
  EXPECT_LT(error.translation().norm(), 0.1);
  const Ledger ledger = house.LastLedger("r1");
  EXPECT_EQ(ledger.received, 60U);
  EXPECT_EQ(ledger.used, 60U);
  EXPECT_EQ(ledger.odometry_received, 60U);
  EXPECT_EQ(ledger.dropped_total(), 0U);
  EXPECT_GT(ledger.keyframes, 3U);
  EXPECT_GT(ledger.latency_p99_ms, 0.0);
  ASSERT_TRUE(house.WaitFor([&] { return house.CurrentTiles().size() >= 4; }));
  bool wall_seen = false;
  for (const auto& [key, tile] : house.CurrentTiles()) {
    const auto cells = DecodeCells(tile.bytes, tile.encoding);
    ASSERT_TRUE(cells);
    wall_seen |= std::any_of(cells->begin(), cells->end(), [](std::uint8_t c) { return c > 60 && c <= 100; });
  }
  EXPECT_TRUE(wall_seen);
}

TEST(Server, PathIsThePosesExactlyAsPublished) {
  WholeServer house;
  house.Open("r1", kClient);
  house.Drive("r1", kClient, 0, 40);
  const Reply reply = house.Ask(Of(RequestKind::kPath));
  ASSERT_TRUE(reply.status.ok()) << reply.status.message;
  const auto poses = house.All<PoseReport>();
  ASSERT_EQ(reply.path.size(), poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(reply.path[i].stamp, poses[i].stamp);
    EXPECT_EQ(reply.path[i].T_map_robot, poses[i].T_map_robot);
  }
}

TEST(Server, GivesTheTrajectoryThePipelineGivesAlone) {
  const ServerOptions options = TestOptions();
  Trajectory alone;
  slam::ScanPipeline pipeline(options.slam, {}, slam::SerialFor,
                              {.used =
                                   [&](const Scan& scan, const slam::ScanOutcome& outcome) {
                                     alone.push_back({scan.stamp, outcome.T_map_robot});
                                   },
                               .dropped = [](const Scan&, DropReason) { FAIL(); }});
  for (int step = 0; step < 50; ++step) {
    pipeline.Add(RoomOdometry(step));
    pipeline.Add(std::make_shared<const Scan>(RoomScan(step)));
  }
  WholeServer house(options);
  for (const char* robot : {"r1", "r2", "r3"}) house.Open(robot, kClient);
  for (const char* robot : {"r1", "r2", "r3"}) house.Drive(robot, kClient, 0, 50);
  for (const char* robot : {"r1", "r2", "r3"}) {
    Request request = Of(RequestKind::kPath);
    request.robot = robot;
    const Reply reply = house.Ask(request);
    ASSERT_EQ(reply.path.size(), alone.size());
    for (std::size_t i = 0; i < alone.size(); ++i) EXPECT_EQ(reply.path[i].T_map_robot, alone[i].T_map_robot);
  }
}

TEST(Server, SeveralRobotsWithStartPosesMakeOneMap) {
  WholeServer house;
  const Pose2 start{3.0, -1.0, 0.5};
  house.Open("r1", 1, "lab");
  house.Open("r2", 2, "lab", start);
  house.Drive("r1", 1, 0, 5);
  house.Drive("r2", 2, 0, 5);
  for (const PoseReport& pose : house.All<PoseReport>()) {
    if (pose.robot == "r2" && pose.scan_sequence == 1) {
      EXPECT_EQ(pose.T_map_robot, start);
    }
  }
  ASSERT_TRUE(house.WaitFor([&] {
    const Reply info = house.Ask(Of(RequestKind::kMapInfo));
    return info.maps.size() == 1 && info.maps[0].robots == 2 && info.maps[0].tile_count > 0;
  }));
}

TEST(Server, TileQueriesAnswerByAreaLevelAndVersion) {
  WholeServer house;
  house.Open("r1", kClient);
  house.Drive("r1", kClient, 0, 60);
  ASSERT_TRUE(house.WaitFor([&] { return house.Ask(Of(RequestKind::kTiles)).tiles.size() >= 3; }));
  const Reply all = house.Ask(Of(RequestKind::kTiles));
  Request area = Of(RequestKind::kTiles);
  area.area = {0.5, 0.5, 1.0, 1.0};
  const Reply one = house.Ask(area);
  ASSERT_EQ(one.tiles.size(), 1U);
  EXPECT_EQ(one.tiles[0].key, (TileKey{0, 0, 0}));
  Request coarse = Of(RequestKind::kTiles);
  coarse.level = 3;
  const Reply top = house.Ask(coarse);
  EXPECT_FALSE(top.tiles.empty());
  EXPECT_LE(top.tiles.size(), all.tiles.size());
  // Once the last scans are drawn and encoded, nothing is newer than what one has.
  Request since = Of(RequestKind::kTiles);
  EXPECT_TRUE(house.WaitFor([&] {
    const Reply newest = house.Ask(Of(RequestKind::kTiles));
    since.since_generation = WholeServer::kGeneration;
    since.since_epoch = newest.map_epoch;
    since.since_version = newest.map_version;
    return house.Ask(since).tiles.empty();
  }));
  // Of what an earlier start of the server has called so, nothing is known.
  since.since_generation = WholeServer::kGeneration - 1;
  EXPECT_EQ(house.Ask(since).tiles.size(), house.Ask(Of(RequestKind::kTiles)).tiles.size());
  since.since_generation = WholeServer::kGeneration;
  since.since_version = 0;
  EXPECT_EQ(house.Ask(since).tiles.size(), house.Ask(Of(RequestKind::kTiles)).tiles.size());
}

TEST(Server, SmoothingMakesANewMapVersionThatCanBeRolledBack) {
  WholeServer house;
  house.Open("r1", kClient);
  house.Drive("r1", kClient, 0, 60);
  const Reply submitted = house.Ask(Of(RequestKind::kJobSubmit));
  ASSERT_EQ(submitted.jobs.size(), 1U) << submitted.status.message;
  const Job job = house.WaitJob(submitted.jobs[0].id);
  EXPECT_EQ(job.state, JobState::kSucceeded) << job.message;
  EXPECT_EQ(job.progress, 1.0);
  EXPECT_EQ(job.map_version, 2U);
  EXPECT_GT(job.cost_before, 0.0);
  EXPECT_GE(job.ended, job.started);

  const Reply info = house.Ask(Of(RequestKind::kMapInfo));
  ASSERT_EQ(info.maps.size(), 1U);
  EXPECT_EQ(info.maps[0].epoch, 1U);
  EXPECT_EQ(info.maps[0].enabled_version, 2U);
  ASSERT_TRUE(house.WaitFor([&] {
    const auto tiles = house.CurrentTiles();
    return std::all_of(tiles.begin(), tiles.end(), [](const auto& tile) { return tile.second.epoch == 1; });
  }));
  Request smoothed = Of(RequestKind::kPath);
  smoothed.smoothed = true;
  EXPECT_EQ(house.Ask(smoothed).path.size(), 60U);

  // Streaming goes on under the new epoch.
  house.Drive("r1", kClient, 60, 80);
  EXPECT_EQ(house.All<PoseReport>().back().map_epoch, 1U);

  Request back = Of(RequestKind::kMapEnable);
  back.map_version = 1;
  const Reply rolled = house.Ask(back);
  EXPECT_TRUE(rolled.status.ok()) << rolled.status.message;
  const Reply after = house.Ask(Of(RequestKind::kMapInfo));
  EXPECT_EQ(after.maps[0].epoch, 2U);
  EXPECT_EQ(after.maps[0].enabled_version, 1U);
  house.Drive("r1", kClient, 80, 85);
  EXPECT_EQ(house.LastLedger("r1").used, 85U);
}

TEST(Server, APublishedButDisabledVersionLeavesTheMapAlone) {
  WholeServer house;
  house.Open("r1", kClient);
  house.Drive("r1", kClient, 0, 20);
  Request submit = Of(RequestKind::kJobSubmit);
  submit.enable = false;
  const Job job = house.WaitJob(house.Ask(submit).jobs.at(0).id);
  EXPECT_EQ(job.state, JobState::kSucceeded) << job.message;
  const Reply info = house.Ask(Of(RequestKind::kMapInfo));
  EXPECT_EQ(info.maps[0].epoch, 0U);
  EXPECT_EQ(info.maps[0].enabled_version, 1U);
  ASSERT_EQ(info.maps[0].versions.size(), 2U);
  EXPECT_FALSE(info.maps[0].versions[1].enabled);
}

TEST(Server, RequestsThatCannotBeServedSayWhy) {
  WholeServer house;
  EXPECT_EQ(house.Ask(Of(RequestKind::kPose)).status.code, StatusCode::kNotFound);
  EXPECT_EQ(house.Ask(Of(RequestKind::kTiles)).status.code, StatusCode::kNotFound);
  EXPECT_EQ(house.Ask(Of(RequestKind::kJobSubmit)).status.code, StatusCode::kNotFound);
  EXPECT_EQ(house.Ask(Of(RequestKind::kMapEnable)).status.code, StatusCode::kNotFound);
  EXPECT_EQ(house.Ask(Of(RequestKind::kSessionEnd)).status.code, StatusCode::kNotFound);
  EXPECT_EQ(house.Ask(Of(RequestKind::kJobCancel)).status.code, StatusCode::kNotFound);
  EXPECT_FALSE(house.Ask(Of(RequestKind::kPing)).server_version.empty());
  house.Open("r1", kClient);
  ASSERT_TRUE(house.WaitPhase("r1", kClient, SessionPhase::kActive));
  EXPECT_EQ(house.Ask(Of(RequestKind::kPose)).status.code, StatusCode::kUnavailable);
  const Job job = house.WaitJob(house.Ask(Of(RequestKind::kJobSubmit)).jobs.at(0).id);
  EXPECT_EQ(job.state, JobState::kFailed);
  EXPECT_THAT(job.message, ::testing::HasSubstr("no scans"));
}

TEST(Server, EveryKindOfRequestIsAnsweredToTheOneWhoAsked) {
  WholeServer house;
  for (int kind = 0; kind < kRequestKindCount; ++kind) {
    const Reply reply = house.Ask(Of(static_cast<RequestKind>(kind)));
    EXPECT_NE(reply.status.code, StatusCode::kDeadlineExceeded) << RequestKindName(static_cast<RequestKind>(kind));
    EXPECT_NE(reply.status.code, StatusCode::kInternal) << RequestKindName(static_cast<RequestKind>(kind));
  }
  // A question about one robot or site without its name is not a question about all.
  house.Open("r1", kClient);
  ASSERT_TRUE(house.WaitPhase("r1", kClient, SessionPhase::kActive));
  Request unnamed = Of(RequestKind::kPose);
  unnamed.robot.clear();
  EXPECT_EQ(house.Ask(unnamed).status.code, StatusCode::kNotFound);
  unnamed = Of(RequestKind::kTiles);
  unnamed.site.clear();
  EXPECT_EQ(house.Ask(unnamed).status.code, StatusCode::kNotFound);
}

// A robot that is refused because all are taken left its site behind, and so did every misspelt name.
TEST(Server, NamesThatCameToNothingDoNotUseUpTheSites) {
  ServerOptions options = TestOptions();
  options.robots.max_robots = 1;
  options.maps.max_sites = 2;
  WholeServer house(options);
  house.Open("r1", kClient, "first");
  ASSERT_TRUE(house.WaitPhase("r1", kClient, SessionPhase::kActive));
  for (const char* site : {"a", "b", "c"}) house.Open("r2", 8, site);
  ASSERT_TRUE(house.WaitFor([&] { return house.LastState("r2", 8).site == "c"; }));
  EXPECT_EQ(house.LastState("r2", 8).status.code, StatusCode::kResourceExhausted);
  Request all = Of(RequestKind::kMapInfo);
  all.site.clear();
  EXPECT_EQ(house.Ask(all).maps.size(), 1U);
  // One robot with five names for its site, each of which it gives up.
  for (const std::string site : {"lba", "lbb", "lbc", "lbd", "lab"}) {
    ASSERT_TRUE(house.Ask(Of(RequestKind::kSessionEnd)).status.ok());
    ASSERT_TRUE(house.WaitPhase("r1", kClient, SessionPhase::kEnded));
    ASSERT_TRUE(house.WaitFor([&] {
      house.Open("r1", kClient, site);
      return house.WaitFor([&] { return house.LastState("r1", kClient).site == site; }) &&
             house.LastState("r1", kClient).phase == SessionPhase::kActive;
    })) << site;
  }
}

TEST(Server, JobsAreFoundByIdAndAsAList) {
  WholeServer house;
  house.Open("r1", kClient);
  ASSERT_TRUE(house.WaitPhase("r1", kClient, SessionPhase::kActive));
  Request ask = Of(RequestKind::kJobGet);
  ask.job = house.Ask(Of(RequestKind::kJobSubmit)).jobs.at(0).id;
  EXPECT_EQ(house.Ask(ask).jobs.at(0).id, ask.job);
  EXPECT_EQ(house.Ask(Of(RequestKind::kJobList)).jobs.size(), 1U);
  Request elsewhere = Of(RequestKind::kJobList);
  elsewhere.site = "hall";
  EXPECT_TRUE(house.Ask(elsewhere).jobs.empty());
  ++ask.job;
  EXPECT_EQ(house.Ask(ask).status.code, StatusCode::kNotFound);
}

// An exception in an answer ended the process. Of what can be asked nothing throws, so the test asks what cannot be.
TEST(Server, AnExceptionEndsTheAnswerAndNotTheServer) {
  WholeServer house;
  EXPECT_EQ(house.Ask(Of(static_cast<RequestKind>(200))).status.code, StatusCode::kInternal);
  EXPECT_TRUE(house.Ask(Of(RequestKind::kPing)).status.ok());
}

TEST(Server, EndFinishesWhatWasQueued) {
  WholeServer house;
  house.Open("r1", kClient);
  house.Drive("r1", kClient, 0, 10);
  // The last scan waits for odometry that never comes; the end settles it.
  Scan late = RoomScan(10);
  late.stamp -= kScanPeriod / 2;
  house.SendScan("r1", kClient, late);
  house.End("r1", kClient);
  ASSERT_TRUE(house.WaitPhase("r1", kClient, SessionPhase::kEnded));
  EXPECT_EQ(house.LastLedger("r1").used, 11U);
  EXPECT_EQ(house.LastLedger("r1").waiting, 0U);
  house.SendScan("r1", kClient, RoomScan(11));
  ASSERT_TRUE(
      house.WaitFor([&] { return house.LastLedger("r1").dropped[static_cast<int>(DropReason::kSessionEnded)] == 1; }));
  Request never = Of(RequestKind::kPose);
  never.latest = false;
  never.stamp = 1000 * kNanosPerSecond;
  EXPECT_EQ(house.Ask(never).status.code, StatusCode::kOutOfRange);
}

TEST(Server, AnEndedSessionsPartOfTheMapStaysWhenTheRobotComesBack) {
  WholeServer house;
  house.Open("r1", kClient);
  house.Drive("r1", kClient, 0, 20);
  house.End("r1", kClient);
  ASSERT_TRUE(house.WaitPhase("r1", kClient, SessionPhase::kEnded));
  ASSERT_TRUE(house.WaitFor([&] { return house.CurrentTiles().size() >= 4; }));
  const auto before = house.CurrentTiles();
  house.Open("r1", kClient, "lab", Pose2{0.5, 0.5, 0.0});
  ASSERT_TRUE(house.WaitPhase("r1", kClient, SessionPhase::kActive));
  for (const auto& [key, tile] : before) EXPECT_TRUE(house.CurrentTiles().contains(key));
  ASSERT_TRUE(
      house.WaitFor([&] { return house.Ask(Of(RequestKind::kStatus)).robots.at(0).ledgers.at(0).received == 0; }));
}

TEST(Server, StopFinishesAcceptedScansAndSaysGoodbye) {
  WholeServer house;
  house.Open("r1", kClient);
  house.Drive("r1", kClient, 0, 10);
  for (int step = 10; step < 30; ++step) {
    house.SendOdometry("r1", kClient, RoomOdometry(step));
    house.SendScan("r1", kClient, RoomScan(step));
  }
  house.Stop();
  const Ledger ledger = house.LastLedger("r1");
  EXPECT_EQ(ledger.used, 30U);
  EXPECT_EQ(ledger.waiting, 0U);
  const SessionState state = house.LastState("r1", kClient);
  EXPECT_EQ(state.phase, SessionPhase::kSuspended);
  EXPECT_THAT(state.status.message, ::testing::HasSubstr("stopping"));
}

// A server that smooths, with more jobs waiting, was stopped: it must not finish them first.
TEST(Server, StopCancelsTheRunningJobAndThoseThatWait) {
  WholeServer house;
  house.Open("r1", kClient);
  house.Drive("r1", kClient, 0, 60);
  std::vector<std::uint64_t> jobs;
  for (int i = 0; i < 12; ++i) jobs.push_back(house.Ask(Of(RequestKind::kJobSubmit)).jobs.at(0).id);
  house.Stop();
  std::map<std::uint64_t, JobState> last;
  for (const Job& job : house.All<Job>()) last[job.id] = job.state;
  for (const std::uint64_t id : jobs) EXPECT_TRUE(IsFinal(last.at(id))) << id;
  EXPECT_EQ(last.at(jobs.back()), JobState::kCancelled);
  EXPECT_EQ(house.LastState("r1", kClient).phase, SessionPhase::kSuspended);
}

TEST(Server, StopDropsAndCountsWhatItHasNoTimeFor) {
  ServerOptions options = TestOptions();
  options.server.stop_timeout_s = 0.0;
  WholeServer house(options);
  house.Open("r1", kClient);
  for (int step = 0; step < 40; ++step) {
    house.SendOdometry("r1", kClient, RoomOdometry(step));
    house.SendScan("r1", kClient, RoomScan(step));
  }
  house.Stop();
  const Ledger ledger = house.LastLedger("r1");
  EXPECT_EQ(ledger.received, 40U);
  EXPECT_EQ(ledger.waiting, 0U);
  EXPECT_EQ(ledger.used + ledger.dropped_total(), 40U);
}

}  // namespace
}  // namespace cairn::server::testing
