// Bad input, through the door's admission and the whole server: each is refused or handled under a counted reason, and
// the estimator goes on as if nothing had happened.
#include <gmock/gmock.h>

#include <functional>
#include <limits>
#include <random>
#include <utility>

#include "tests/server/support/whole_server.h"

namespace cairn::server::testing {
namespace {

constexpr ClientId kSender = 7;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

std::uint64_t Dropped(const Ledger& ledger, DropReason reason) {
  return ledger.dropped[static_cast<std::size_t>(reason)];
}

class BadInput : public ::testing::Test {
 protected:
  void SetUp() override {
    house_.Open("r1", kSender);
    house_.Drive("r1", kSender, 0, 10);
  }
  // Scan 11 spoilt; then the robot drives on, and the spoilt scan is the only one not used.
  void ExpectRefused(DropReason reason, const std::function<void(Scan&)>& spoil) {
    Scan scan = RoomScan(10);
    spoil(scan);
    house_.SendOdometry("r1", kSender, RoomOdometry(10));
    house_.SendScan("r1", kSender, scan);
    DriveOn(1);
    EXPECT_EQ(Dropped(house_.LastLedger("r1"), reason), 1U) << DropReasonName(reason);
  }
  void DriveOn(std::uint64_t expected_drops) {
    house_.Drive("r1", kSender, 11, 20);
    const Ledger ledger = house_.LastLedger("r1");
    EXPECT_EQ(ledger.dropped_total(), expected_drops);
    EXPECT_EQ(ledger.received + Dropped(ledger, DropReason::kLostOnWire), ledger.used + ledger.dropped_total());
    const Pose2 error = Between(TruePose(19), house_.All<PoseReport>().back().T_map_robot);
    EXPECT_LT(error.translation().norm(), 0.1);
  }

  WholeServer house_;
};

TEST_F(BadInput, SingleBadRangesAreNormal) {
  Scan scan = RoomScan(10);
  scan.ranges_m[3] = kNan;
  scan.ranges_m[40] = kInf;
  scan.ranges_m[41] = -kInf;
  scan.ranges_m[60] = -2.0F;
  scan.ranges_m[80] = 0.0F;
  house_.SendOdometry("r1", kSender, RoomOdometry(10));
  house_.SendScan("r1", kSender, scan);
  DriveOn(0);
}

TEST_F(BadInput, AScanOfNothingButBadRangesIsEmpty) {
  ExpectRefused(DropReason::kEmpty, [](Scan& scan) { scan.ranges_m.assign(181, kNan); });
}

TEST_F(BadInput, AScanWithoutBeamsIsEmpty) {
  ExpectRefused(DropReason::kEmpty, [](Scan& scan) { scan.ranges_m.clear(); });
}

TEST_F(BadInput, TooManyBeamsAreRefused) {
  ExpectRefused(DropReason::kTooManyBeams, [](Scan& scan) { scan.ranges_m.assign(kMaxBeams + 1, 3.0F); });
}

TEST_F(BadInput, ChangingBeamCountsAreUsed) {
  Scan scan = RoomScan(10);
  scan.ranges_m.resize(91);  // The right half of the view.
  house_.SendOdometry("r1", kSender, RoomOdometry(10));
  house_.SendScan("r1", kSender, scan);
  DriveOn(0);
}

TEST_F(BadInput, GeometryThatDescribesNoScannerIsRefused) {
  ExpectRefused(DropReason::kBadGeometry, [](Scan& scan) { scan.angle_step_rad = 0.0; });
}

TEST_F(BadInput, NotANumberInTheMountingIsRefused) {
  ExpectRefused(DropReason::kBadGeometry, [](Scan& scan) { scan.T_robot_laser.x = kNan; });
}

TEST_F(BadInput, RangeLimitsTheWrongWayRoundAreRefused) {
  ExpectRefused(DropReason::kBadGeometry, [](Scan& scan) { scan.range_max_m = -1.0; });
}

TEST_F(BadInput, AStampThatRepeatsIsRefused) {
  ExpectRefused(DropReason::kDuplicateStamp, [](Scan& scan) { scan.stamp = RoomScan(9).stamp; });
}

TEST_F(BadInput, AStampThatGoesBackIsRefused) {
  ExpectRefused(DropReason::kStampWentBack, [](Scan& scan) { scan.stamp = RoomScan(5).stamp; });
}

TEST_F(BadInput, AStampThatJumpsAYearIsRefused) {
  ExpectRefused(DropReason::kStampJump, [](Scan& scan) { scan.stamp += 365LL * 86400 * kNanosPerSecond; });
}

TEST_F(BadInput, BadOdometryIsCountedAndLeftOut) {
  Odometry wild = RoomOdometry(10);
  wild.T_odom_robot.y = std::numeric_limits<double>::infinity();
  wild.sequence = 0;  // Without a number nothing is taken for a duplicate.
  house_.SendOdometry("r1", kSender, wild);
  Odometry old = RoomOdometry(3);
  house_.SendOdometry("r1", kSender, old);  // Sent again: not counted.
  old.sequence = 0;
  house_.SendOdometry("r1", kSender, old);
  house_.SendOdometry("r1", kSender, RoomOdometry(10));
  house_.SendScan("r1", kSender, RoomScan(10));
  DriveOn(0);
  EXPECT_EQ(house_.LastLedger("r1").odometry_dropped, 2U);
}

TEST_F(BadInput, LateOdometryIsWaitedFor) {
  house_.SendScan("r1", kSender, RoomScan(10));
  ASSERT_TRUE(house_.WaitFor([&] { return house_.LastLedger("r1").waiting == 1; }));
  house_.SendOdometry("r1", kSender, RoomOdometry(10));
  DriveOn(0);
}

TEST_F(BadInput, MissingOdometryDropsTheScanWithAReason) {
  // Three seconds without odometry, then it comes back: what lies in the gap has no odometry near.
  for (int step = 10; step < 40; ++step) house_.SendScan("r1", kSender, RoomScan(step));
  house_.SendOdometry("r1", kSender, RoomOdometry(45));
  house_.SendScan("r1", kSender, RoomScan(45));
  // The last scan settles last; before it arrives, a ledger may already show the gap's thirty and no loss.
  house_.WaitSettled("r1", RoomScan(45).sequence);
  const Ledger ledger = house_.LastLedger("r1");
  EXPECT_EQ(Dropped(ledger, DropReason::kNoOdometry), 30U);
  EXPECT_EQ(Dropped(ledger, DropReason::kLostOnWire), 5U);  // Sequences 41 to 45 were never sent.
}

// Random ranges once made a map of hundreds of megabytes in half a minute.
TEST_F(BadInput, ALostRobotDrawsNothingIntoTheMapOfItsSite) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> range(0.5F, 19.0F);
  const auto drive = [&](int first, int last) {
    for (int step = first; step < last; ++step) {
      Scan scan = RoomScan(step);
      for (float& one : scan.ranges_m) one = range(random);
      house_.SendOdometry("r1", kSender, RoomOdometry(step));
      house_.SendScan("r1", kSender, scan);
      if (step % 8 == 7) house_.WaitSettled("r1", static_cast<std::uint64_t>(step) + 1);
    }
    house_.WaitSettled("r1", static_cast<std::uint64_t>(last));
  };
  // When it has not changed for a while.
  const auto map_version = [this] {
    std::uint64_t version = 0;
    int same = 0;
    EXPECT_TRUE(house_.WaitFor([&] {
      Request about;
      about.kind = RequestKind::kMapInfo;
      about.site = "lab";
      same = std::exchange(version, house_.Ask(about).maps.at(0).version) == version ? same + 1 : 0;
      return same == 10;
    }));
    return version;
  };
  house_.Drive("r1", kSender, 10, 60);
  drive(60, 120);
  ASSERT_EQ(house_.All<PoseReport>().back().reason, PoseReason::kLost);
  const std::uint64_t before = map_version();
  EXPECT_GT(before, 0U);
  drive(120, 240);
  EXPECT_EQ(house_.All<PoseReport>().back().reason, PoseReason::kLost);
  EXPECT_EQ(map_version(), before);
}

TEST_F(BadInput, GapsInTheNumbersAreLostAndLateArrivalsFillThem) {
  house_.SendOdometry("r1", kSender, RoomOdometry(10));
  house_.SendOdometry("r1", kSender, RoomOdometry(11));
  house_.SendScan("r1", kSender, RoomScan(11));
  ASSERT_TRUE(house_.WaitFor([&] { return Dropped(house_.LastLedger("r1"), DropReason::kLostOnWire) == 1; }));
  house_.SendScan("r1", kSender, RoomScan(10));
  ASSERT_TRUE(house_.WaitFor([&] { return Dropped(house_.LastLedger("r1"), DropReason::kLostOnWire) == 0; }));
  EXPECT_EQ(Dropped(house_.LastLedger("r1"), DropReason::kStampWentBack), 1U);
}

TEST_F(BadInput, AResentScanIsNotCountedTwice) {
  house_.SendScan("r1", kSender, RoomScan(9));
  house_.SendScan("r1", kSender, RoomScan(4));
  house_.SendOdometry("r1", kSender, RoomOdometry(10));
  house_.SendScan("r1", kSender, RoomScan(10));
  DriveOn(0);
  EXPECT_EQ(house_.LastLedger("r1").received, 20U);
}

TEST_F(BadInput, ARobotThatConnectsTwiceIsRefusedWhileTheFirstLives) {
  house_.Open("r1", 8);
  ASSERT_TRUE(house_.WaitPhase("r1", 8, SessionPhase::kRefused));
  EXPECT_EQ(house_.LastState("r1", 8).status.code, StatusCode::kAlreadyExists);
  house_.SendScan("r1", 8, RoomScan(10));
  ASSERT_TRUE(house_.WaitFor([&] { return Dropped(house_.LastLedger("r1"), DropReason::kNotOwner) == 1; }));

  house_.Push(ClientLiveliness{kSender, HashName("r1"), false});
  ASSERT_TRUE(house_.WaitPhase("r1", kSender, SessionPhase::kSuspended));
  house_.Open("r1", 8, "lab", TruePose(10));
  ASSERT_TRUE(house_.WaitPhase("r1", 8, SessionPhase::kActive));
  // The new client numbers from 1, and its session begins where it says.
  for (int step = 10; step < 20; ++step) {
    Scan scan = RoomScan(step);
    scan.sequence = static_cast<std::uint64_t>(step) - 9;
    house_.SendOdometry("r1", 8, RoomOdometry(step));
    house_.SendScan("r1", 8, scan);
  }
  ASSERT_TRUE(house_.WaitFor([&] { return house_.All<PoseReport>().back().stamp == RoomScan(19).stamp; }));
  const PoseReport last = house_.All<PoseReport>().back();
  EXPECT_EQ(last.session, house_.TokenOf("r1", 8));
  EXPECT_EQ(last.scan_sequence, 10U);
  EXPECT_LT(Between(TruePose(19), last.T_map_robot).translation().norm(), 0.1);
}

TEST_F(BadInput, ScansWithoutASessionAreCountedInABoundedTable) {
  house_.SendScan("stranger", 99, RoomScan(0));
  ASSERT_TRUE(house_.WaitFor([&] { return Dropped(house_.LastLedger("stranger"), DropReason::kNoSession) == 1; }));
  for (int i = 0; i < 1000; ++i) house_.SendScan("stranger" + std::to_string(i), 99, RoomScan(0));
  house_.SendOdometry("r1", kSender, RoomOdometry(10));
  house_.SendScan("r1", kSender, RoomScan(10));
  DriveOn(0);
  std::set<NameId> strangers;
  for (const Ledger& ledger : house_.All<Ledger>()) strangers.insert(ledger.robot_id);
  EXPECT_LE(strangers.size(), static_cast<std::size_t>(TestOptions().robots.max_unclaimed) + 1);
  // A stranger that opens a session at last keeps what was counted.
  house_.Open("stranger", 99);
  ASSERT_TRUE(house_.WaitFor([&] { return house_.LastLedger("stranger").robot == "stranger"; }));
  EXPECT_EQ(Dropped(house_.LastLedger("stranger"), DropReason::kNoSession), 1U);
}

// Whoever used the robot's name before it opened its session must not use up its numbers.
TEST(BadSession, AStrangersNumbersAreNotTheOwners) {
  WholeServer house;
  for (int step = 0; step < 40; ++step) house.SendScan("r1", 99, RoomScan(step));
  ASSERT_TRUE(house.WaitFor([&] { return Dropped(house.LastLedger("r1"), DropReason::kNoSession) == 40; }));
  house.Open("r1", kSender);
  house.Drive("r1", kSender, 0, 20);
  EXPECT_TRUE(house.WaitFor([&] { return house.LastLedger("r1").used == 20; }));
  EXPECT_EQ(house.LastLedger("r1").settled_through, 20U);
}

// A robot that outlived the server goes on counting; what the server before had used is not lost.
TEST(BadSession, ARobotThatWasThereBeforeTheServerHasLostNothing) {
  WholeServer house;
  house.Open("r1", kSender);
  for (int step = 165; step < 180; ++step) {
    house.SendOdometry("r1", kSender, RoomOdometry(step));
    house.SendScan("r1", kSender, RoomScan(step));
  }
  house.WaitSettled("r1", 180);
  EXPECT_EQ(house.LastLedger("r1").used, 15U);
  EXPECT_EQ(Dropped(house.LastLedger("r1"), DropReason::kLostOnWire), 0U);
}

TEST(BadSession, UnknownSitesAreRefusedWhereTheServerMakesNone) {
  ServerOptions options = TestOptions();
  options.server.create_sites = false;
  options.server.sites = "hall, lab";
  WholeServer house(options);
  house.Open("r1", kSender, "nowhere");
  ASSERT_TRUE(house.WaitPhase("r1", kSender, SessionPhase::kRefused));
  EXPECT_EQ(house.LastState("r1", kSender).status.code, StatusCode::kNotFound);
  EXPECT_THAT(house.LastState("r1", kSender).status.message, ::testing::HasSubstr("nowhere"));
  house.Open("r1", kSender, "hall");
  EXPECT_TRUE(house.WaitPhase("r1", kSender, SessionPhase::kActive));
}

TEST(BadSession, RequestsThatMakeNoSenseAreRefusedWithAReason) {
  WholeServer house;
  const SessionRequest good{.robot = "r1",
                            .site = "lab",
                            .sensors = {"laser"},
                            .client = kSender,
                            .has_start = true,
                            .T_map_robot_start = {},
                            .end = false,
                            .session = kSender};
  const auto expect_refused = [&house](SessionRequest request) {
    const std::string robot = request.robot;
    const ClientId client = request.client;
    const auto count = [&] {
      const auto refusals = house.All<SessionRefusal>();
      return std::count_if(refusals.begin(), refusals.end(), [&](const SessionRefusal& refusal) {
        return refusal.state.status.code == StatusCode::kInvalidArgument;
      });
    };
    const auto before = count();
    house.Push(std::move(request));
    EXPECT_TRUE(house.WaitFor([&] { return count() == before + 1; })) << robot << " " << client;
  };
  SessionRequest bad = good;
  bad.robot = "../etc";
  expect_refused(bad);
  bad = good;
  bad.site = "";
  expect_refused(bad);
  bad = good;
  bad.client = 0;
  expect_refused(bad);
  bad = good;
  bad.session = 0;
  expect_refused(bad);
  bad = good;
  bad.sensors = {"odometry"};
  expect_refused(bad);
  bad = good;
  bad.sensors.clear();
  expect_refused(bad);
  bad = good;
  bad.sensors.assign(17, "laser");
  expect_refused(bad);
  bad = good;
  bad.sensors = {"no such\nname"};
  expect_refused(bad);
  bad = good;
  bad.T_map_robot_start.theta = kNan;
  expect_refused(bad);
  bad = good;
  bad.T_map_robot_start.x = 1e9;
  expect_refused(bad);
}

}  // namespace
}  // namespace cairn::server::testing
