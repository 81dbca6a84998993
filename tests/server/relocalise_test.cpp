// A person says that a robot is not where its pose says, through the whole server.
#include <gmock/gmock.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

Request Relocalise(const std::optional<Pose2>& T_map_robot, const std::string& robot = "r1") {
  Request request = About(RequestKind::kRelocalise, robot);
  request.T_map_robot = T_map_robot;
  return request;
}

PoseReport LastPose(const WholeServer& house) {
  return house.All<PoseReport>().back();
}

double ErrorAfter(const PoseReport& pose, int step) {
  return (pose.T_map_robot.translation() - TruePose(step).translation()).norm();
}

TEST(Relocalise, TheRobotIsNotLocalizedUntilItWasFoundWhereItIsSaidToBe) {
  WholeServer house;
  house.Open("r1", kDriver);
  house.Drive("r1", kDriver, 0, 60);
  ASSERT_TRUE(LastPose(house).localized);
  ASSERT_TRUE(house.Ask(Relocalise(std::nullopt)).status.ok());
  house.Drive("r1", kDriver, 60, 61);
  EXPECT_FALSE(LastPose(house).localized);
  EXPECT_EQ(LastPose(house).reason, PoseReason::kLost);
  // At a wrong place it is not found.
  ASSERT_TRUE(house.Ask(Relocalise(TruePose(60) * Pose2{2.5, 0.0, 1.0})).status.ok());
  house.Drive("r1", kDriver, 61, 62);
  EXPECT_FALSE(LastPose(house).localized);
  ASSERT_TRUE(house.Ask(Relocalise(TruePose(61) * Pose2{0.4, 0.3, 0.2})).status.ok());
  house.Drive("r1", kDriver, 62, 63);
  EXPECT_TRUE(LastPose(house).localized);
  EXPECT_LT(ErrorAfter(LastPose(house), 62), 0.1);
}

TEST(Relocalise, WhatCannotBeSaidIsRefusedWithAReason) {
  WholeServer house;
  EXPECT_EQ(house.Ask(Relocalise(Pose2{}, "r9")).status.code, StatusCode::kNotFound);
  house.Open("r1", kDriver);
  house.Drive("r1", kDriver, 0, 10);
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  for (const Pose2& absurd : {Pose2{kNone, 0, 0}, Pose2{0, 1e300, 0}, Pose2{0, 0, kNone}})
    EXPECT_EQ(house.Ask(Relocalise(absurd)).status.code, StatusCode::kInvalidArgument);
  // Its place in the map of the site is not known: it is a fragment.
  house.Open("r2", 8, "lab", std::nullopt);
  ASSERT_TRUE(house.WaitPhase("r2", 8, SessionPhase::kActive));
  const Reply fragment = house.Ask(Relocalise(Pose2{}, "r2"));
  EXPECT_EQ(fragment.status.code, StatusCode::kFailedPrecondition);
  EXPECT_THAT(fragment.status.message, ::testing::HasSubstr("not joined"));
  EXPECT_TRUE(house.Ask(Relocalise(std::nullopt, "r2")).status.ok());
  house.End("r1", kDriver);
  ASSERT_TRUE(house.WaitPhase("r1", kDriver, SessionPhase::kEnded));
  EXPECT_EQ(house.Ask(Relocalise(Pose2{})).status.code, StatusCode::kFailedPrecondition);
  EXPECT_TRUE(LastPose(house).localized);
}

TEST(Relocalise, AServerThatStartsAgainKnowsWhatWasSaid) {
  for (const bool checkpoint : {false, true}) {
    const TempDirectory directory;
    ServerOptions options = TestOptions();
    if (checkpoint) options.robots.checkpoint_entries = 10;
    Trajectory before;
    {
      StoredServer first(directory / "0", options);
      first->Open("r1", kDriver);
      first->Drive("r1", kDriver, 0, 60);
      ASSERT_TRUE(first->Ask(Relocalise(TruePose(59) * Pose2{0.5, 0.0, 0.0})).status.ok());
      first->Drive("r1", kDriver, 60, 62);
      ASSERT_TRUE(first->Ask(Relocalise(std::nullopt)).status.ok());
      first->Drive("r1", kDriver, 62, 90);
      ASSERT_TRUE(first->WaitFor([&] { return DurableScans(first.house()) == 90; }));
      EXPECT_FALSE(
          std::ranges::all_of(first->All<PoseReport>(), [](const PoseReport& pose) { return pose.localized; }));
      before = PathOf(first.house());
      CopyState(directory / "0", directory / "1");
    }
    ASSERT_EQ(before.size(), 90U);
    StoredServer second(directory / "1", options);
    EXPECT_TRUE(SamePath(PathOf(second.house()), before));
  }
}

}  // namespace
}  // namespace cairn::server::testing
