// Where a robot is said to start in a map that others have made: who is believed, and for how long.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

constexpr ClientId kMapper = 9, kFirst = 7, kSecond = 8;

class Start : public ::testing::Test {
 protected:
  void SetUp() override {
    house_.Open("r0", kMapper);
    house_.Drive("r0", kMapper, 0, 20);
    ASSERT_TRUE(house_.WaitFor([this] {
      const Reply map = house_.Ask(About(RequestKind::kMapInfo));
      return !map.maps.empty() && map.maps[0].tile_count > 0;
    }));
    house_.Open("r1", kFirst);  // With a start.
    ASSERT_TRUE(house_.WaitPhase("r1", kFirst, SessionPhase::kActive));
  }
  // Scans and odometry of some steps, whose numbers begin behind so many that never arrived.
  void Send(ClientId client, std::uint64_t missing, int steps) {
    for (int step = 0; step < steps; ++step) {
      Odometry odometry = RoomOdometry(step);
      odometry.sequence += missing;
      house_.SendOdometry("r1", client, odometry);
      Scan scan = RoomScan(step);
      scan.sequence += missing;
      house_.SendScan("r1", client, std::move(scan));
    }
  }
  [[nodiscard]] PoseReport FirstPose() {
    static_cast<void>(house_.WaitFor([this] { return !Poses().empty(); }));
    return Poses().empty() ? PoseReport{} : Poses().front();
  }
  [[nodiscard]] std::vector<PoseReport> Poses() const {
    std::vector<PoseReport> poses;
    for (const PoseReport& pose : house_.All<PoseReport>()) {
      if (pose.robot == "r1") poses.push_back(pose);
    }
    return poses;
  }

  WholeServer house_;
};

TEST_F(Start, IsBelievedOfTheClientThatSaidIt) {
  Send(kFirst, 0, 4);
  EXPECT_TRUE(FirstPose().localized);
}

// A few scans are lost now and then.
TEST_F(Start, IsBelievedAlsoWhereTheFirstScansAreMissing) {
  Send(kFirst, 5, 4);
  EXPECT_TRUE(FirstPose().localized);
}

// The robot may have been carried away since, or have another's name.
TEST_F(Start, IsNotBelievedOfAClientThatSaysNothing) {
  house_.Push(ClientLiveliness{kFirst, HashName("r1"), false});
  ASSERT_TRUE(house_.WaitPhase("r1", kFirst, SessionPhase::kSuspended));
  house_.Open("r1", kSecond, "lab", std::nullopt);
  ASSERT_TRUE(house_.WaitPhase("r1", kSecond, SessionPhase::kActive));
  Send(kSecond, 0, 4);
  EXPECT_FALSE(FirstPose().localized);
  EXPECT_EQ(FirstPose().reason, PoseReason::kNotJoined);
}

// The robot has driven on while nothing of it arrived.
TEST_F(Start, IsNotBelievedAMinuteLater) {
  Send(kFirst, 600, 4);
  EXPECT_FALSE(FirstPose().localized);
  EXPECT_EQ(FirstPose().reason, PoseReason::kNotJoined);
}

// It was to begin the map; but nothing of it arrived until others had begun it.
TEST_F(Start, IsNotBelievedAMinuteLaterInASiteThatWasEmpty) {
  const auto open = [this](const std::string& robot, ClientId client) {
    house_.Open(robot, client, "yard");
    ASSERT_TRUE(house_.WaitPhase(robot, client, SessionPhase::kActive));
  };
  open("late", 41);
  open("first", 42);
  house_.Drive("first", 42, 0, 20);
  ASSERT_TRUE(house_.WaitFor([this] {
    Request about = About(RequestKind::kMapInfo);
    about.site = "yard";
    const Reply map = house_.Ask(about);
    return !map.maps.empty() && map.maps[0].tile_count > 0;
  }));
  for (int step = 0; step < 4; ++step) {
    Odometry odometry = RoomOdometry(step);
    odometry.sequence += 600;
    house_.SendOdometry("late", 41, odometry);
    Scan scan = RoomScan(step);
    scan.sequence += 600;
    house_.SendScan("late", 41, std::move(scan));
  }
  std::optional<PoseReport> pose;
  ASSERT_TRUE(house_.WaitFor([&] {
    for (const PoseReport& one : house_.All<PoseReport>())
      if (!pose && one.robot == "late") pose = one;
    return pose.has_value();
  }));
  EXPECT_FALSE(pose->localized);
  EXPECT_EQ(pose->reason, PoseReason::kNotJoined);
}

// All of them arrived, and the server could use none: its queue was full, or nothing said how the robot had moved.
TEST_F(Start, IsNotBelievedWhereTheServerDroppedTheFirstScans) {
  constexpr ClientId kThird = 30;
  house_.Open("r3", kThird, "lab", Pose2{40.0, 0.0, 0.0});
  ASSERT_TRUE(house_.WaitPhase("r3", kThird, SessionPhase::kActive));
  Odometry later = RoomOdometry(30);  // Of the scans before it nothing says how the robot had moved.
  later.sequence -= 30;
  house_.SendOdometry("r3", kThird, later);
  for (int step = 0; step < 40; ++step) house_.SendScan("r3", kThird, RoomScan(step));
  for (int step = 31; step < 44; ++step) {
    Odometry odometry = RoomOdometry(step);
    odometry.sequence -= 30;
    house_.SendOdometry("r3", kThird, odometry);
  }
  ASSERT_NO_FATAL_FAILURE(house_.WaitSettled("r3", 40));
  const auto poses = house_.All<PoseReport>();
  const auto first = std::ranges::find(poses, "r3", &PoseReport::robot);
  ASSERT_NE(first, poses.end());
  EXPECT_FALSE(first->localized);
  EXPECT_EQ(first->reason, PoseReason::kNotJoined);
  // Nor is what it draws shown, 40 m away from the map.
  const auto version = [this] { return house_.Ask(About(RequestKind::kMapInfo)).map_version; };
  const std::uint64_t before = version();
  house_.Drive("r0", kMapper, 20, 40);
  ASSERT_TRUE(house_.WaitFor([&] { return version() > before; }));
  for (const auto& [key, tile] : house_.CurrentTiles()) EXPECT_LT(key.x, 3) << key.y << " " << int{key.level};
}

// Opens a session with a start that is known in this map, drives a little, and returns the first pose.
PoseReport FirstPoseFrom(WholeServer& house, const std::string& robot, ClientId client, std::uint64_t map_frame) {
  house.Open(robot, client, "lab", Pose2{}, map_frame);
  EXPECT_TRUE(house.WaitPhase(robot, client, SessionPhase::kActive));
  house.Drive(robot, client, 0, 20);
  std::optional<PoseReport> first;
  static_cast<void>(house.WaitFor([&] {
    for (const PoseReport& pose : house.All<PoseReport>())
      if (!first && pose.robot == robot) first = pose;
    return first.has_value();
  }));
  return first.value_or(PoseReport{});
}

// The robot knows where it is in another map of this name, perhaps with another origin.
TEST_F(Start, IsNotBelievedFromAnotherMap) {
  const std::uint64_t here = house_.LastState("r1", kFirst).map_frame;
  EXPECT_NE(here, 0U);
  EXPECT_TRUE(FirstPoseFrom(house_, "same", 21, here).localized);
  EXPECT_EQ(FirstPoseFrom(house_, "other", 22, here + 2).reason, PoseReason::kNotJoined);
}

// The server has lost its state: the first robot that comes back begins the map again where it was in the old one, and
// the others know their places in the same map.
TEST(StartInAnEmptySite, TheMapGoesOnInTheFrameThatTheFirstRobotKnows) {
  WholeServer house;
  EXPECT_TRUE(FirstPoseFrom(house, "r0", kMapper, 4711).localized);
  EXPECT_EQ(house.LastState("r0", kMapper).map_frame, 4711U);
  EXPECT_TRUE(FirstPoseFrom(house, "r1", kFirst, 4711).localized);
  EXPECT_EQ(FirstPoseFrom(house, "r2", kSecond, 4713).reason, PoseReason::kNotJoined);
}

// Also after a restart.
TEST(StoredFrame, IsThatOfTheMapForEver) {
  const TempDirectory directory;
  std::uint64_t first = 0;
  for (int start = 0; start < 3; ++start) {
    StoredServer server(directory / "0");
    server->Open("r0", kMapper);
    ASSERT_TRUE(server->WaitPhase("r0", kMapper, SessionPhase::kActive));
    const std::uint64_t now = server->LastState("r0", kMapper).map_frame;
    if (start == 0) first = now;
    EXPECT_EQ(now, first);
    server->Drive("r0", kMapper, 10 * start, 10 * start + 10);
  }
}

}  // namespace
}  // namespace cairn::server::testing
