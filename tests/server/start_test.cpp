// Where a robot is said to start in a map that others have made: who is believed, and for how long.
#include <gtest/gtest.h>

#include "tests/server/support/stored_server.h"

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

}  // namespace
}  // namespace cairn::server::testing
