// A robot that is only localised in the map that others have made, through the whole server.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>

#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

constexpr ClientId kGuest = 9;
constexpr std::ptrdiff_t kKnownCells = 18'000;  // That r1 sees, and a few more.

PoseReport LastPoseOf(const WholeServer& house, const std::string& robot) {
  std::optional<PoseReport> last;
  for (const PoseReport& pose : house.All<PoseReport>())
    if (pose.robot == robot) last = pose;
  return last.value_or(PoseReport{});
}

Status Ask(WholeServer& house, RequestKind kind, const std::string& robot) {
  return house.Ask(About(kind, robot)).status;
}

// All that a server has drawn, for which it must end: only then the last of it is published.
std::map<TileKey, TileCells> StopAndGetCells(WholeServer& house) {
  house.Stop();
  std::map<TileKey, TileCells> drawn;
  for (const auto& [key, tile] : house.CurrentTiles()) drawn[key] = *DecodeCells(tile.bytes, tile.encoding);
  return drawn;
}

bool IsMapPublished(WholeServer& house) {
  std::ptrdiff_t known = 0;
  for (const auto& [key, tile] : house.CurrentTiles()) {
    if (key.level != 0) continue;
    const TileCells cells = *DecodeCells(tile.bytes, tile.encoding);
    known += std::ranges::count_if(cells, [](std::uint8_t cell) { return cell != kUnknownCell; });
  }
  return known > kKnownCells;
}

// r1 has drawn the map, and nearly all that it has seen is published.
void DrawMap(WholeServer& house) {
  house.Open("r1", kDriver);
  house.Drive("r1", kDriver, 0, 60);
  ASSERT_TRUE(house.WaitFor([&] { return IsMapPublished(house); }));
}

TEST(Localise, ARobotIsLocalizedInTheMapOfOthersAndChangesNothing) {
  WholeServer house;
  ASSERT_NO_FATAL_FAILURE(DrawMap(house));
  house.End("r1", kDriver);
  ASSERT_TRUE(house.WaitPhase("r1", kDriver, SessionPhase::kEnded));
  house.Open("r2", kGuest, "lab", TruePose(0));
  ASSERT_TRUE(Ask(house, RequestKind::kLocalise, "r2").ok());
  house.Drive("r2", kGuest, 0, 40);
  const PoseReport pose = LastPoseOf(house, "r2");
  EXPECT_TRUE(pose.localized) << PoseReasonName(pose.reason) << " scan " << pose.scan_sequence << " epoch "
                              << pose.map_epoch;
  EXPECT_LT((pose.T_map_robot.translation() - TruePose(39).translation()).norm(), 0.1);
  const Reply status = house.Ask(About(RequestKind::kStatus, "r2"));
  ASSERT_EQ(status.robots.size(), 1U);
  EXPECT_THAT(status.robots[0].session.status.message, ::testing::HasSubstr("only localised"));
  // The map is the one that r1 alone has drawn.
  WholeServer alone;
  ASSERT_NO_FATAL_FAILURE(DrawMap(alone));
  EXPECT_TRUE(StopAndGetCells(house) == StopAndGetCells(alone));
}

TEST(Localise, ARobotMapsAgainFromWhereItIs) {
  WholeServer house;
  ASSERT_NO_FATAL_FAILURE(DrawMap(house));
  house.Open("r2", kGuest, "lab", TruePose(0));
  ASSERT_TRUE(Ask(house, RequestKind::kLocalise, "r2").ok());
  house.Drive("r2", kGuest, 0, 40);
  ASSERT_TRUE(Ask(house, RequestKind::kMap, "r2").ok());
  house.Drive("r2", kGuest, 40, 60);
  EXPECT_TRUE(LastPoseOf(house, "r2").localized);
  EXPECT_LT((LastPoseOf(house, "r2").T_map_robot.translation() - TruePose(59).translation()).norm(), 0.1);
  EXPECT_TRUE(house.Ask(About(RequestKind::kStatus, "r2")).robots.at(0).session.status.message.empty());
}

// After a switch of the map version a pose is localized only in the map of the epoch that it names.
TEST(Localise, ARobotFollowsTheMapToItsNextVersion) {
  WholeServer house;
  ASSERT_NO_FATAL_FAILURE(DrawMap(house));
  house.Open("r2", kGuest, "lab", TruePose(0));
  ASSERT_TRUE(Ask(house, RequestKind::kLocalise, "r2").ok());
  house.Drive("r2", kGuest, 0, 20);
  ASSERT_TRUE(LastPoseOf(house, "r2").localized);
  const Reply submitted = house.Ask(About(RequestKind::kJobSubmit, ""));
  ASSERT_EQ(submitted.jobs.size(), 1U) << submitted.status.message;
  ASSERT_EQ(house.WaitJob(submitted.jobs[0].id).state, JobState::kSucceeded);
  ASSERT_TRUE(house.WaitFor([&] { return house.Ask(About(RequestKind::kMapInfo, "")).maps.at(0).epoch == 1U; }));
  int step = 20;
  ASSERT_TRUE(house.WaitFor([&] {
    house.Drive("r2", kGuest, step, step + 1);
    ++step;
    const PoseReport pose = LastPoseOf(house, "r2");
    return pose.localized && pose.map_epoch == 1U;
  }));
  EXPECT_LT((LastPoseOf(house, "r2").T_map_robot.translation() - TruePose(step - 1).translation()).norm(), 0.15);
}

TEST(Localise, WhatCannotBeIsRefusedWithAReason) {
  WholeServer house;
  EXPECT_EQ(Ask(house, RequestKind::kLocalise, "r9").code, StatusCode::kNotFound);
  EXPECT_EQ(Ask(house, RequestKind::kMap, "r9").code, StatusCode::kNotFound);
  ASSERT_NO_FATAL_FAILURE(DrawMap(house));
  // It can be localised in the map, but draw nothing into it, because nobody knows where its own map lies.
  house.Open("r2", kGuest, "lab", std::nullopt);
  ASSERT_TRUE(house.WaitPhase("r2", kGuest, SessionPhase::kActive));
  EXPECT_TRUE(Ask(house, RequestKind::kLocalise, "r2").ok());
  const Status again = Ask(house, RequestKind::kMap, "r2");
  EXPECT_EQ(again.code, StatusCode::kFailedPrecondition);
  EXPECT_THAT(again.message, ::testing::HasSubstr("not joined"));
  house.End("r1", kDriver);
  ASSERT_TRUE(house.WaitPhase("r1", kDriver, SessionPhase::kEnded));
  EXPECT_EQ(Ask(house, RequestKind::kLocalise, "r1").code, StatusCode::kFailedPrecondition);
}

TEST(Localise, AServerThatStartsAgainGoesOnLocalising) {
  for (const bool checkpoint : {false, true}) {
    SCOPED_TRACE(checkpoint);
    const TempDirectory directory;
    ServerOptions options = TestOptions();
    if (checkpoint) options.robots.checkpoint_entries = 10;
    Trajectory before;
    {
      StoredServer first(directory / "0", options);
      ASSERT_NO_FATAL_FAILURE(DrawMap(*first.operator->()));
      first->Open("r2", kGuest, "lab", TruePose(0));
      ASSERT_TRUE(Ask(*first.operator->(), RequestKind::kLocalise, "r2").ok());
      first->Drive("r2", kGuest, 0, 30);
      EXPECT_TRUE(LastPoseOf(*first.operator->(), "r2").localized);
      before = PathOf(*first.operator->(), "r2");
      ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->(), "r2") == 30; }));
    }
    StoredServer second(directory / "0", options);
    WholeServer& house = *second.operator->();
    const Trajectory after = PathOf(house, "r2");
    ASSERT_EQ(after.size(), before.size());
    for (std::size_t i = 0; i < after.size(); ++i) EXPECT_EQ(after[i].T_map_robot, before[i].T_map_robot);
    EXPECT_THAT(house.Ask(About(RequestKind::kStatus, "r2")).robots.at(0).session.status.message,
                ::testing::Not(::testing::HasSubstr("maps")));
  }
}

// Also after a restart, when each has read its map from its own checkpoint.
TEST(Localise, RobotsInTheSameMapShareIt) {
  constexpr ClientId kOther = 10;
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 10;
  {
    StoredServer first(directory / "0", options);
    WholeServer& house = *first.operator->();
    ASSERT_NO_FATAL_FAILURE(DrawMap(house));
    house.End("r1", kDriver);
    ASSERT_TRUE(house.WaitPhase("r1", kDriver, SessionPhase::kEnded));
  }
  {
    // What r1 has drawn last may be published at any time until the server has ended; from then on the map stays.
    StoredServer first(directory / "0", options);
    WholeServer& house = *first.operator->();
    ASSERT_TRUE(house.WaitFor([&] { return IsMapPublished(house); }));
    EXPECT_EQ(house.server().known_maps(), 0U);
    for (const auto& [robot, client] : {std::pair{"r2", kGuest}, std::pair{"r3", kOther}}) {
      house.Open(robot, client, "lab", TruePose(0));
      ASSERT_TRUE(Ask(house, RequestKind::kLocalise, robot).ok());
      house.Drive(robot, client, 0, 30);
      EXPECT_TRUE(LastPoseOf(house, robot).localized) << robot;
      ASSERT_TRUE(first->WaitFor([&house, name = robot] { return DurableScans(house, name) == 30; }));
    }
    EXPECT_EQ(house.server().known_maps(), 1U);
  }
  StoredServer second(directory / "0", options);
  EXPECT_EQ(second->server().known_maps(), 1U);
}

}  // namespace
}  // namespace cairn::server::testing
