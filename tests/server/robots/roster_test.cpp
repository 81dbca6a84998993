#include "server/robots/roster.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <set>
#include <utility>

#include "tests/server/robots/roster_fixture.h"

namespace cairn::server {
namespace {

using testing::Dropped;
using ::testing::HasSubstr;
using testing::kLane;
using testing::OdometryOf;
using testing::RequestOf;
using testing::RoomOdometry;
using testing::RoomScan;
using testing::RosterTest;
using testing::ScanOf;
using testing::Sent;

TEST_F(RosterTest, OpensASessionInItsSite) {
  roster().Take(RequestOf("r1", 7));
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kActive);
  EXPECT_EQ(LastState("r1", 7).site, "lab");
  ASSERT_NE(roster().Find("r1"), nullptr);
  const auto site = atlas_->Find("lab");
  EXPECT_TRUE(sent_.WaitFor([&] {
    site->Publish();
    return site->snapshot()->info.robots == 1;
  }));
  EXPECT_EQ(roster().InSite("lab").size(), 1U);
  EXPECT_TRUE(roster().InSite("hall").empty());
  EXPECT_EQ(roster().Find("r2"), nullptr);
}

TEST_F(RosterTest, TheOwnerMayAskAgainAndAnotherLiveClientMayNot) {
  roster().Take(RequestOf("r1", 7));
  const SessionId first = roster().Find("r1")->id();
  roster().Take(RequestOf("r1", 7));
  EXPECT_EQ(roster().Find("r1")->id(), first);
  roster().Take(RequestOf("r1", 8));
  EXPECT_EQ(LastState("r1", 8).phase, SessionPhase::kRefused);
  EXPECT_EQ(LastState("r1", 8).status.code, StatusCode::kAlreadyExists);
  EXPECT_EQ(roster().Find("r1")->record().owner(), 7U);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kActive);
}

// A client that had been cut off went on streaming for ever into a session that was another's by then.
TEST_F(RosterTest, AClientWhoseSessionIsTakenOverIsTold) {
  roster().Take(RequestOf("r1", 7));
  Suspend(7);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kSuspended);
  roster().Take(RequestOf("r1", 8));
  EXPECT_EQ(LastState("r1", 8).phase, SessionPhase::kActive);
  EXPECT_EQ(LastRefusal("r1", 7).phase, SessionPhase::kRefused);
  EXPECT_EQ(LastRefusal("r1", 7).status.code, StatusCode::kAlreadyExists);
  // Its lease comes back: that changes nothing for the new owner.
  roster().Take(ClientLiveliness{7, HashName("r1"), true});
  EXPECT_EQ(roster().Find("r1")->record().owner(), 8U);
}

TEST_F(RosterTest, AnAnswerTheLaneHadNoRoomForIsSentLater) {
  roster().Take(RequestOf("r1", 7));
  FillLane();
  roster().Take(RequestOf("r1", 8));
  EXPECT_EQ(LastState("r1", 8).client, 0U);
  roster().Tick();
  EXPECT_EQ(LastState("r1", 8).phase, SessionPhase::kRefused);
  const std::size_t told = sent().All<SessionState>().size();
  roster().Tick();
  EXPECT_EQ(sent().All<SessionState>().size(), told);
}

TEST_F(RosterTest, ARefusalThatWasNotSentIsForgottenWhenTheClientIsLetIn) {
  roster().Take(RequestOf("r1", 7));
  FillLane();
  roster().Take(RequestOf("r1", 8));
  Suspend(7);
  sent();
  roster().Take(RequestOf("r1", 8));
  roster().Tick();
  EXPECT_EQ(LastState("r1", 8).phase, SessionPhase::kActive);
}

// Clients that are refused again and again while nothing can be sent must not use up the memory.
TEST_F(RosterTest, RefusalsThatCannotBeSentAreBoundedAndTheNewestAreKept) {
  constexpr ClientId kFirst = 1000, kRefused = 300, kKept = 256;
  roster().Take(RequestOf("r1", 7));
  sent();
  FillLane();
  for (ClientId client = kFirst; client < kFirst + kRefused; ++client) roster().Take(RequestOf("r1", client));
  // Each round empties the lane and fills it again with what waits.
  for (int round = 0; round < 4; ++round) {
    sent();
    roster().Tick();
  }
  std::set<ClientId> told;
  for (const SessionRefusal& refusal : sent().All<SessionRefusal>()) told.insert(refusal.state.client);
  EXPECT_EQ(told.size(), kKept);
  EXPECT_FALSE(told.contains(kFirst + kRefused - kKept - 1));
  EXPECT_TRUE(told.contains(kFirst + kRefused - kKept));
  EXPECT_TRUE(told.contains(kFirst + kRefused - 1));
}

TEST_F(RosterTest, AnOpenSessionStaysInItsSiteAndHasABoundOnSensors) {
  roster().Take(RequestOf("r1", 7));
  SessionRequest elsewhere = RequestOf("r1", 7);
  elsewhere.site = "hall";
  roster().Take(elsewhere);
  EXPECT_EQ(LastState("r1", 7).status.code, StatusCode::kFailedPrecondition);
  SessionRequest many = RequestOf("r1", 7);
  many.sensors.clear();
  for (std::size_t i = 0; i < SessionRecord::kMaxSensors; ++i) many.sensors.push_back("s" + std::to_string(i));
  roster().Take(many);  // Sixteen more than the laser.
  EXPECT_EQ(LastState("r1", 7).status.code, StatusCode::kResourceExhausted);
  EXPECT_EQ(roster().Find("r1")->record().snapshot().status.ledgers.size(), 1U);
}

TEST_F(RosterTest, OnlyTheOwnerEndsASession) {
  SessionRequest end = RequestOf("r1", 8);
  end.end = true;
  roster().Take(end);
  EXPECT_EQ(LastState("r1", 8).status.code, StatusCode::kNotFound);
  roster().Take(RequestOf("r1", 7));
  roster().Take(end);
  EXPECT_EQ(LastState("r1", 8).status.code, StatusCode::kPermissionDenied);
  end.client = 7;
  roster().Take(end);
  ASSERT_TRUE(WaitPhase("r1", 7, SessionPhase::kEnded));
  EXPECT_TRUE(LastState("r1", 7).status.ok());
  EXPECT_TRUE(roster().End("r1"));
  EXPECT_EQ(roster().End("r9").error().code, StatusCode::kNotFound);
}

TEST_F(RosterTest, AnEndedSessionGivesWayToANewOneOfItsRobot) {
  roster().Take(RequestOf("r1", 7));
  const SessionId first = roster().Find("r1")->id();
  ASSERT_TRUE(roster().End("r1"));
  ASSERT_TRUE(WaitPhase("r1", 7, SessionPhase::kEnded));
  roster().Take(RequestOf("r1", 7));  // The same session: it stays ended.
  EXPECT_EQ(roster().Find("r1")->id(), first);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kEnded);
  SessionRequest anew = RequestOf("r1", 7);
  anew.session = 70;
  roster().Take(anew);
  EXPECT_GT(roster().Find("r1")->id(), first);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kActive);  // And no word of the old one after it.
}

TEST_F(RosterTest, ASessionWhoseRobotStaysAwayIsEnded) {
  RobotsOptions options;
  options.suspended_expiry_s = 0.05;
  roster(options).Take(RequestOf("r1", 7));
  roster().Take(RequestOf("r2", 8));
  Suspend(7);
  ASSERT_TRUE(sent_.WaitFor([&] {
    roster().Tick();
    return LastState("r1", 7).phase == SessionPhase::kEnded;
  }));
  EXPECT_THAT(LastState("r1", 7).status.message, HasSubstr("suspended_expiry_s"));
  EXPECT_EQ(LastState("r2", 8).phase, SessionPhase::kActive);
}

// Ended sessions of robots that never came back took memory, and time of each start, until every place was taken.
TEST_F(RosterTest, ASessionThatEndedLongAgoIsNoLongerShown) {
  RobotsOptions options;
  options.suspended_expiry_s = 0.05;
  roster(options).Take(RequestOf("r1", 7));
  ASSERT_TRUE(roster().End("r1"));
  ASSERT_TRUE(sent_.WaitFor([&] {
    roster().Tick();
    return roster().Find("r1") == nullptr;
  }));
  ASSERT_TRUE(sent_.WaitFor([&] {
    roster().Tick();
    return !sent().All<Retired>().empty();
  }));
  // It may come back.
  roster().Take(RequestOf("r1", 7));
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kActive);
}

TEST_F(RosterTest, ARobotThatComesBackInTimeIsNotEnded) {
  roster().Take(RequestOf("r1", 7));
  Suspend(7);
  roster().Tick();
  EXPECT_FALSE(roster().Find("r1")->ending());
  roster().Take(RequestOf("r1", 7));
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kActive);
}

// Two hundred and fifty-six robots that had vanished kept every other robot out for ever.
TEST_F(RosterTest, WhenPlacesRunOutTheEndedGoFirstThenTheLongestAway) {
  RobotsOptions options;
  options.max_robots = 3;
  options.place_kept_s = 0.0;
  roster(options).Take(RequestOf("ended", 1));
  roster().Take(RequestOf("away", 2));
  roster().Take(RequestOf("away_later", 3));
  Suspend(2);
  Suspend(3);
  ASSERT_TRUE(roster().End("ended"));
  ASSERT_TRUE(WaitPhase("ended", 1, SessionPhase::kEnded));

  roster().Take(RequestOf("r4", 4));
  EXPECT_EQ(LastState("r4", 4).phase, SessionPhase::kActive);
  EXPECT_EQ(roster().Find("ended"), nullptr);
  EXPECT_NE(roster().Find("away"), nullptr);

  roster().Take(RequestOf("r5", 5));
  EXPECT_EQ(roster().Find("away"), nullptr);
  EXPECT_NE(roster().Find("away_later"), nullptr);
  ASSERT_TRUE(WaitPhase("away", 2, SessionPhase::kEnded));
  EXPECT_EQ(LastState("away", 2).status.code, StatusCode::kResourceExhausted);

  roster().Take(RequestOf("r6", 6));
  EXPECT_EQ(roster().Find("away_later"), nullptr);
  roster().Take(RequestOf("r7", 8));  // Everybody left is active.
  EXPECT_EQ(LastState("r7", 8).phase, SessionPhase::kRefused);
  EXPECT_EQ(LastState("r7", 8).status.code, StatusCode::kResourceExhausted);
  EXPECT_EQ(roster().All().size(), 3U);
  EXPECT_EQ(outbound_.over_limit(), 1U);  // `cairn status` prints how many were refused.
}

// After a start of the server every robot is away for a moment, and a newcomer that asked first took the place of one
// that was driving.
TEST_F(RosterTest, ARobotThatIsAwayForAMomentKeepsItsPlace) {
  RobotsOptions options;
  options.max_robots = 1;
  roster(options).Take(RequestOf("r1", 7));
  Suspend(7);
  roster().Take(RequestOf("r2", 8));
  EXPECT_EQ(LastState("r2", 8).phase, SessionPhase::kRefused);
  EXPECT_EQ(LastState("r2", 8).status.code, StatusCode::kResourceExhausted);
  ASSERT_NE(roster().Find("r1"), nullptr);
  EXPECT_EQ(roster().Find("r1")->record().phase(), SessionPhase::kSuspended);
}

// Sixty-four misspelt site names, from a robot there was no room for, filled the list of sites.
TEST_F(RosterTest, WhoeverIsRefusedLeavesNoSiteBehind) {
  RobotsOptions options;
  options.max_robots = 1;
  roster(options).Take(RequestOf("r1", 7));
  SessionRequest late = RequestOf("r2", 8);
  late.site = "misspelt";
  roster().Take(late);
  EXPECT_EQ(LastState("r2", 8).status.code, StatusCode::kResourceExhausted);
  EXPECT_EQ(atlas_->Find("misspelt"), nullptr);
}

TEST_F(RosterTest, ASiteThatCanNotBeEnteredDisplacesNobody) {
  RobotsOptions options;
  options.max_robots = 1;
  options.place_kept_s = 0.0;
  roster(options, false).Take(RequestOf("r1", 7));
  Suspend(7);
  SessionRequest request = RequestOf("r2", 8);
  request.site = "nowhere";
  roster().Take(request);
  EXPECT_EQ(LastState("r2", 8).status.code, StatusCode::kNotFound);
  EXPECT_NE(roster().Find("r1"), nullptr);
}

TEST_F(RosterTest, ScansFindTheirSessionOrAreCounted) {
  roster().Take(ScanOf("r1", RoomScan(0), 7));
  roster().Take(OdometryOf("r1", RoomOdometry(0), 7));
  roster().Tick();
  ASSERT_EQ(sent().All<Ledger>().size(), 1U);
  EXPECT_EQ(Dropped(sent().All<Ledger>().back(), DropReason::kNoSession), 1U);

  roster().Take(RequestOf("r1", 7));
  for (int step = 1; step < 4; ++step) {
    roster().Take(OdometryOf("r1", RoomOdometry(step), 7));
    roster().Take(ScanOf("r1", RoomScan(step), 7));
  }
  const auto session = roster().Find("r1");
  const auto ledger = [&] { return session->record().snapshot().status.ledgers.at(0); };
  ASSERT_TRUE(sent_.WaitFor([&] { return ledger().used == 3; }));
  EXPECT_EQ(Dropped(ledger(), DropReason::kNoSession), 1U);  // The account went on.
  EXPECT_EQ(ledger().received, 4U);

  ScanArrival undeclared = ScanOf("r1", RoomScan(4), 7);
  undeclared.stream.sensor_id = HashName("sonar");
  roster().Take(std::move(undeclared));
  ScanArrival foreign = ScanOf("r1", RoomScan(4), 8);
  foreign.stream.sensor_id = HashName("radar");
  roster().Take(std::move(foreign));
  roster().Tick();
  std::uint64_t no_session = 0, not_owner = 0;
  for (const Ledger& counted : sent().All<Ledger>()) {
    if (counted.sensor_id == HashName("sonar")) no_session = Dropped(counted, DropReason::kNoSession);
    if (counted.sensor_id == HashName("radar")) not_owner = Dropped(counted, DropReason::kNotOwner);
  }
  EXPECT_EQ(no_session, 1U);
  EXPECT_EQ(not_owner, 1U);
}

TEST_F(RosterTest, ALeaseConcernsEverySessionOfItsClientAndNoOther) {
  roster().Take(RequestOf("r1", 7));
  roster().Take(RequestOf("r2", 7));
  roster().Take(RequestOf("r3", 8));
  Suspend(7);
  EXPECT_EQ(LastState("r1", 7).phase, SessionPhase::kSuspended);
  EXPECT_EQ(LastState("r2", 7).phase, SessionPhase::kSuspended);
  EXPECT_EQ(LastState("r3", 8).phase, SessionPhase::kActive);
}

// Destroying an hour's estimator takes long; every stream and question waited for the roster meanwhile.
TEST_F(RosterTest, FreesTheMemoryOfASessionWithoutItsLock) {
  bool freed = false, locked = false;
  std::future<void> asked;
  RobotsOptions options;
  options.max_robots = 1;
  roster(options).Take(RequestOf("r1", 7));
  ScanArrival arrival = ScanOf("r1", RoomScan(0), 7);
  // The estimator keeps its first scan, so that this runs when its memory is freed.
  arrival.scan = std::shared_ptr<const Scan>(new Scan(*arrival.scan), [&](const Scan* scan) {
    delete scan;
    asked = std::async(std::launch::async, [this] { static_cast<void>(roster().All()); });
    locked = asked.wait_for(std::chrono::seconds(2)) != std::future_status::ready;
    freed = true;
  });
  roster().Take(OdometryOf("r1", RoomOdometry(0), 7));
  roster().Take(std::move(arrival));
  ASSERT_TRUE(roster().End("r1"));
  ASSERT_TRUE(WaitPhase("r1", 7, SessionPhase::kEnded));
  const std::weak_ptr<Session> ended = roster().Find("r1");
  EXPECT_EQ(ended.lock()->record().snapshot().status.ledgers.at(0).used, 1U);
  ASSERT_TRUE(sent_.WaitFor([&] { return ended.use_count() == 1; }));  // Nobody but the roster holds it.
  EXPECT_FALSE(freed);
  roster().Take(RequestOf("r2", 8));  // Which takes its place.
  EXPECT_TRUE(freed);
  EXPECT_FALSE(locked);
}

}  // namespace
}  // namespace cairn::server
