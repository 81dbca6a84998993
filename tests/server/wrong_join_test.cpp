// Two robots are joined at a wrong place, because each has seen another one of two equal wings. What they see later
// tells.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <string>

#include "tests/server/slam/equal_wings.h"
#include "tests/server/support/walled_robot.h"

namespace cairn::server::testing {
namespace {

constexpr double kWingM = 32.0, kHallM = 76.0, kStepM = 0.2;
constexpr std::size_t kStepsOfWing = 160;

const slam::test::World& Wings() {
  static const slam::test::World world = slam::test::EqualWings(kWingM, kHallM);
  return world;
}

WalledRobot InWings(const std::string& name, ClientId client, const Pose2& start, const slam::test::StepList& way) {
  slam::test::Laser laser = slam::test::FullTurnLaser();
  laser.range_max_m = 12.0;
  laser.sigma_m = 0.01;
  return {name, client, Wings(), laser, start, way.steps()};
}

TEST(WrongJoin, IsTakenBackByJobsWhenMoreIsSeenElsewhere) {
  WholeServer house(JoiningOptions(true));
  WalledRobot first =
      InWings("r1", kDriver, {}, slam::test::StepList(kStepM).Ahead(kWingM).Turn(kPi / 2).Ahead(kHallM - 4.0));
  WalledRobot second = InWings("r2", kOther, {kWingM, kHallM, kPi},
                               slam::test::StepList(kStepM)
                                   .Ahead(kWingM)
                                   .Turn(kPi)
                                   .Ahead(kWingM)
                                   .Turn(-kPi / 2)
                                   .Ahead(kHallM - 4.0)
                                   .Turn(kPi)
                                   .Ahead(kHallM - 4.0));
  first.Open(house);
  first.Drive(house, kStepsOfWing);
  second.Open(house);
  second.Drive(house, kStepsOfWing);
  ASSERT_TRUE(house.WaitFor([&] { return JoinedBy(house).has_value(); }));
  const std::uint32_t version = JoinedBy(house)->map_version;
  ASSERT_TRUE(house.WaitFor([&] { return InfoOf(house).enabled_version == version; }));
  second.Drive(house, 2);
  ASSERT_TRUE(second.LastPose(house).localized);
  ASSERT_GT(second.Error(second.LastPose(house)), 20.0) << "this is no wrong join";

  first.Drive(house, first.left());
  const auto is_taken_back = [&] {
    const auto job = JoinedBy(house);
    return job && job->message.find("from its place") != std::string::npos;
  };
  while (second.left() > 60 && !is_taken_back()) {
    second.Drive(house, 40);
    // A job sees it only if it has time to.
    ASSERT_TRUE(house.WaitFor([&] {
      const Reply reply = house.Ask(About(RequestKind::kJobList));
      return std::ranges::all_of(reply.jobs, [](const Job& job) { return IsFinal(job.state); });
    }));
  }
  ASSERT_TRUE(is_taken_back());
  const std::uint32_t corrected = JoinedBy(house)->map_version;
  ASSERT_TRUE(house.WaitFor([&] { return InfoOf(house).enabled_version == corrected; }));
  second.Drive(house, 20);
  first.Drive(house, 2);
  constexpr double kDriftM = 2.0;  // Of a way of 100 m on which no place is seen again.
  EXPECT_TRUE(second.LastPose(house).localized);
  EXPECT_LT(second.Error(second.LastPose(house)), kDriftM);
  EXPECT_LT(first.Error(first.LastPose(house)), kDriftM);
}

}  // namespace
}  // namespace cairn::server::testing
