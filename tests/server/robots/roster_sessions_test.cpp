// Which sessions a roster knows, and when it gives their keys back.
#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <thread>
#include <type_traits>
#include <variant>
#include <vector>

#include "tests/eventually.h"
#include "tests/server/robots/roster_fixture.h"

namespace cairn::server {
namespace {

using ::testing::HasSubstr;
using testing::OdometryOf;
using testing::RequestOf;
using testing::RoomOdometry;
using testing::RoomScan;
using testing::RosterTest;
using testing::ScanOf;

// After a restart of the server, robots were put where they had once begun.
TEST_F(RosterTest, ASessionThatWasStartedElsewhereIsNotOpenedAtItsOldStart) {
  SessionRequest started = RequestOf("r1", 7);
  started.started = true;
  roster().Take(started);
  EXPECT_EQ(roster().Find("r1"), nullptr);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kRefused);
  EXPECT_EQ(LastState("r1", 7).status.code, StatusCode::kFailedPrecondition);
  EXPECT_THAT(LastState("r1", 7).status.message, HasSubstr("does not know this session"));
  started.session = 70;
  started.started = false;
  roster().Take(started);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kActive);
  EXPECT_EQ(LastState("r1", 7).session, 70U);
  started.started = true;  // Known here.
  roster().Take(started);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kActive);
}

TEST_F(RosterTest, AnotherProcessMayContinueASessionThatItKnows) {
  roster().Take(RequestOf("r1", 7));
  Suspend(7);
  SessionRequest same = RequestOf("r1", 8);
  same.session = 7;
  same.started = true;
  roster().Take(same);
  EXPECT_EQ(LastState("r1", 8).phase, SessionPhase::kActive);
  EXPECT_EQ(roster().Find("r1")->record().owner(), 8U);
}

TEST_F(RosterTest, ARobotThatDoesNotSayWhereItStartsIsAFragmentWhereOthersHaveBegunAMap) {
  const auto is_fragment = [&](const std::string& robot) { return roster().Find(robot)->record().joining().fragment; };
  roster().Take(RequestOf("r1", 7));
  EXPECT_FALSE(is_fragment("r1"));  // It begins the map.
  roster().Take(RequestOf("r2", 8));
  EXPECT_TRUE(is_fragment("r2"));
  SessionRequest known = RequestOf("r3", 9);
  known.has_start = true;
  roster().Take(known);
  EXPECT_FALSE(is_fragment("r3"));
  SessionRequest elsewhere = RequestOf("r4", 10);
  elsewhere.site = "hall";
  roster().Take(elsewhere);
  EXPECT_FALSE(is_fragment("r4"));
}

// Only fragments are left, and they have begun nothing that others could be joined with.
TEST_F(RosterTest, ARobotThatFindsNoMapBeginsIt) {
  roster().Take(RequestOf("r1", 7));
  roster().Take(RequestOf("r2", 8));
  ASSERT_TRUE(roster().End("r1"));  // It has not seen anything.
  ASSERT_TRUE(WaitPhase("r1", 7, SessionPhase::kEnded));
  roster().Take(RequestOf("r3", 9));
  EXPECT_FALSE(roster().Find("r3")->record().joining().fragment);
}

// Its program was started again before its lidar was up. It was a fragment for ever then, in a site without a map.
TEST_F(RosterTest, ARobotThatIsStartedAgainBeforeItsFirstScanStillBeginsTheMap) {
  roster().Take(RequestOf("r1", 7));
  Suspend(7);
  roster().Take(RequestOf("r1", 8));
  ASSERT_EQ(LastState("r1", 8).phase, SessionPhase::kActive);
  EXPECT_FALSE(roster().Find("r1")->record().joining().fragment);
}

// Nothing of the map is shown, but there is one, in which the robot is somewhere.
TEST_F(RosterTest, ARobotThatDoesNotSayWhereItStartsIsAFragmentWhereAMapIsLoadedOrCannotBeRead) {
  const auto is_fragment = [&](const std::string& robot) { return roster().Find(robot)->record().joining().fragment; };
  Roster& robots = roster();
  const auto lab = atlas_->Find("lab");
  lab->SetLoading(true);
  robots.Take(RequestOf("r1", 7));
  EXPECT_TRUE(is_fragment("r1"));
  lab->SetLoading(false);
  robots.Take(RequestOf("r2", 8));
  EXPECT_FALSE(is_fragment("r2"));
  ASSERT_TRUE(robots.End("r2"));
  ASSERT_TRUE(WaitPhase("r2", 8, SessionPhase::kEnded));
  lab->LosePart();
  robots.Take(RequestOf("r3", 9));
  EXPECT_TRUE(is_fragment("r3"));
}

TEST_F(RosterTest, WhatARobotHasDrawnIsAMapAlsoAfterItHasGone) {
  ASSERT_NO_FATAL_FAILURE(DriveAndEnd("r1", 7));
  SessionRequest again = RequestOf("r1", 7);
  again.session = 70;
  roster().Take(again);
  EXPECT_TRUE(roster().Find("r1")->record().joining().fragment);
}

// As after a start: the map of an earlier session is not rendered yet.
TEST_F(RosterTest, WhatAnEarlierSessionHasDrawnIsAMapBeforeItIsShown) {
  ASSERT_NO_FATAL_FAILURE(DriveAndEnd("r1", 7));
  SessionRequest elsewhere = RequestOf("r1", 7);
  elsewhere.session = 70;
  elsewhere.site = "hall";
  roster().Take(elsewhere);
  ASSERT_EQ(roster().Find("r1")->record().state().site, "hall");
  ASSERT_EQ(atlas_->Find("lab")->snapshot()->info.tile_count, 0U);
  roster().Take(RequestOf("r9", 9));
  EXPECT_TRUE(roster().Find("r9")->record().joining().fragment);
}

// Robot r1 has drawn something, its session has ended, and another one follows.
void BeginAgain(Roster& roster, const std::function<bool()>& ended) {
  roster.Take(RequestOf("r1", 7));
  for (int step = 0; step < 5; ++step) {
    roster.Take(OdometryOf("r1", RoomOdometry(step), 7));
    roster.Take(ScanOf("r1", RoomScan(step), 7));
  }
  ASSERT_TRUE(roster.End("r1"));
  ASSERT_TRUE(ended());
  SessionRequest again = RequestOf("r1", 7);
  again.session = 70;
  again.has_start = true;
  roster.Take(again);
  roster.Tick();
}

TEST_F(RosterTest, TheEarlierSessionOfARobotStillAnswersForItsSite) {
  ASSERT_NO_FATAL_FAILURE(BeginAgain(roster(), [&] { return WaitPhase("r1", 7, SessionPhase::kEnded); }));
  EXPECT_EQ(roster().All().size(), 1U);
  const auto sessions = roster().InSite("lab");
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_TRUE(sessions[0]->record().snapshot().path.empty()) << "nobody can ask for it";
  std::promise<std::size_t> keyframes;
  ASSERT_TRUE(sessions[0]->Post(
      SnapshotWanted{[&](SessionMaterial&& material) { keyframes.set_value(material.snapshot.keyframes.size()); }}));
  EXPECT_GT(keyframes.get_future().get(), 0U);
  EXPECT_EQ(roster().Find("r1")->record().token(), 70U);

  // One that has not seen anything is of no use.
  ASSERT_TRUE(roster().End("r1"));
  ASSERT_TRUE(WaitPhase("r1", 7, SessionPhase::kEnded));
  SessionRequest third = RequestOf("r1", 7);
  third.session = 71;
  roster().Take(third);
  roster().Tick();
  EXPECT_EQ(roster().InSite("lab").size(), 2U);
}

TEST_F(RosterTest, EarlierSessionsAreBounded) {
  RobotsOptions options;
  options.max_earlier = 0;
  ASSERT_NO_FATAL_FAILURE(BeginAgain(roster(options), [&] { return WaitPhase("r1", 7, SessionPhase::kEnded); }));
  // The thread that ended the session may not have left it yet.
  EXPECT_TRUE(test::Eventually([&] {
    roster().Tick();
    return roster().InSite("lab").size() == 1;
  }));
}

// Its layer stays, so the map is the same.
TEST_F(RosterTest, ASiteThatTakesTooMuchMemoryDoesWithoutAnEarlierSessionWhereOthersHaveDrawn) {
  maps_.max_memory_mib = 1e-3;
  ASSERT_NO_FATAL_FAILURE(BeginAgain(roster(), [&] { return WaitPhase("r1", 7, SessionPhase::kEnded); }));
  const auto lab = atlas_->Find("lab");
  const auto tick = [&] {
    lab->Publish();
    roster().Tick();
    static_cast<void>(sent());
  };
  ASSERT_TRUE(test::Eventually([&] {
    tick();
    return lab->gives_no_more();
  }));
  EXPECT_EQ(roster().InSite("lab").size(), 2U) << "nobody else has drawn there";
  SessionRequest other = RequestOf("r2", 8);
  other.has_start = true;
  roster().Take(other);
  for (int step = 0; step < 5; ++step) {
    roster().Take(OdometryOf("r2", RoomOdometry(step), 8));
    roster().Take(ScanOf("r2", RoomScan(step), 8));
  }
  EXPECT_EQ(roster().InSite("lab").size(), 3U);
  EXPECT_TRUE(test::Eventually([&] {
    tick();
    return roster().InSite("lab").size() == 2;
  }));
  EXPECT_TRUE(test::Eventually([&] {
    tick();
    return lab->snapshot()->info.memory_note.find("earlier sessions forgotten but for their map: 1") !=
           std::string::npos;
  }));
  EXPECT_NE(lab->snapshot()->tiles.Find({0, 0, 0}), nullptr);
}

TEST_F(RosterTest, TheKeysOfASessionThatIsGoneAreGivenBack) {
  RobotsOptions options;
  options.max_robots = 1;
  roster(options).Take(RequestOf("r1", 7));
  ASSERT_TRUE(roster().End("r1"));
  ASSERT_TRUE(WaitPhase("r1", 7, SessionPhase::kEnded));
  roster().Take(RequestOf("r2", 8));
  std::vector<std::size_t> kinds;
  ASSERT_TRUE(sent_.WaitFor([&] {
    roster().Tick();
    return sent().All<Retired>().size() >= 4;
  }));
  for (const Retired& retired : sent().All<Retired>()) {
    kinds.push_back(retired.of.index());
    std::visit(
        [](const auto& of) {
          if constexpr (requires { of.robot_id; }) {
            EXPECT_EQ(of.robot_id, HashName("r1"));
          }
        },
        retired.of);
  }
  EXPECT_THAT(kinds, ::testing::UnorderedElementsAre(0, 1, 2, 2));  // State, pose, the ledgers of laser and odometry.
  roster().Tick();
  EXPECT_EQ(sent().All<Retired>().size(), 4U);
}

// Between entering the site and being known, a session could lose its site to somebody who deleted it.
TEST_F(RosterTest, NoSessionIsOpenInASiteThatIsDeleted) {
  roster();
  std::atomic<bool> opened = false;
  std::jthread deletes([&] {
    while (!opened) {
      if (roster().RemoveSite("brief")) atlas_->Release("brief");
    }
  });
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  int open = 0;
  for (SessionToken i = 1; open < 200 && std::chrono::steady_clock::now() < end; ++i) {
    SessionRequest request = RequestOf("r1", 7);
    request.site = "brief";
    request.session = i;
    roster().Take(request);
    const auto session = roster().Find("r1");
    if (session == nullptr || session->record().state().session != request.session) continue;
    ++open;
    EXPECT_NE(atlas_->Find("brief"), nullptr) << i;
    request.end = true;
    roster().Take(request);
    roster().Tick();
  }
  opened = true;
  EXPECT_EQ(open, 200);
}

}  // namespace
}  // namespace cairn::server
