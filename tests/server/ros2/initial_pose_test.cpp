// Somebody says where a ROS 2 robot is: within a session the server is asked to look for it there; otherwise the next
// session begins there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/server/ros2/ros_robot.h"

namespace cairn::server {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

const Status kNotJoined{StatusCode::kFailedPrecondition, "the robot is not joined with the map of its site"};

class InitialPose : public RosRobot {
 protected:
  // A robot with a session of which a scan was used.
  void Drive() {
    Open();
    Pose();
  }
  void ScanAgain() {
    ++number_;
    Odom(number_);
    Scan(number_);
  }
  std::int64_t number_ = 1;
};

TEST_F(InitialPose, IsAHintWhereTheRobotHasASession) {
  Drive();
  EXPECT_FALSE(robot_.TakeHint());
  SayWhereItIs(3.0);
  EXPECT_TRUE(Everything().empty()) << "the session goes on";
  const auto hint = robot_.TakeHint();
  ASSERT_TRUE(hint);
  EXPECT_EQ(hint->request.kind, RequestKind::kRelocalise);
  EXPECT_EQ(hint->request.robot, "r1");
  ASSERT_TRUE(hint->request.T_map_robot);
  EXPECT_EQ(hint->request.T_map_robot->x, 3.0);
  EXPECT_EQ(hint->request.T_map_robot->y, 4.0);
  EXPECT_FALSE(robot_.TakeHint()) << "once";
  robot_.Take(State(SessionPhase::kActive), now_);
  robot_.TakeHintAnswer(hint->number, {});
  ScanAgain();
  EXPECT_TRUE(Pushed<SessionRequest>().empty());
  EXPECT_TRUE(robot_.open());
  EXPECT_FALSE(robot_.TakeHint());
}

TEST_F(InitialPose, BeginsANewSessionWhereTheServerCannotLookForTheRobot) {
  Drive();
  for (const StatusCode code : {StatusCode::kFailedPrecondition, StatusCode::kNotFound}) {
    SayWhereItIs(3.0);
    const auto hint = robot_.TakeHint();
    ASSERT_TRUE(hint);
    robot_.TakeHintAnswer(hint->number, {code, "no"});
    // What is said late of the old session does not take the start away.
    robot_.Take(State(SessionPhase::kActive), now_);
    ScanAgain();
    const std::vector<InboundValue> values = Everything();
    ASSERT_GE(values.size(), 3U);
    // The old session has no living client any more, so the server lets the new one replace it.
    EXPECT_FALSE(std::get<ClientLiveliness>(values[0]).alive);
    const auto& request = std::get<SessionRequest>(values[1]);
    EXPECT_NE(request.client, request_.client);
    EXPECT_NE(request.session, request_.session);
    EXPECT_TRUE(request.has_start);
    EXPECT_EQ(request.T_map_robot_start.x, 3.0);
    request_ = request;
    ScanAgain();
    EXPECT_TRUE(Pushed<SessionRequest>().empty()) << "one is enough";
    Pose();
  }
}

// In a session without a used scan there is nothing in which the robot could be looked for.
TEST_F(InitialPose, BeginsANewSessionWhereNoScanWasUsedYet) {
  Open();
  SayWhereItIs(3.0);
  EXPECT_FALSE(robot_.TakeHint());
  ScanAgain();
  const std::vector<InboundValue> values = Everything();
  ASSERT_GE(values.size(), 3U);
  EXPECT_FALSE(std::get<ClientLiveliness>(values[0]).alive);
  EXPECT_EQ(std::get<SessionRequest>(values[1]).T_map_robot_start.x, 3.0);
}

// The session would only join it there by a job, later.
TEST_F(InitialPose, ARobotThatIsNotJoinedWithTheMapBeginsAnewThere) {
  Open();
  Pose(false, PoseReason::kNotJoined);
  SayWhereItIs(3.0);
  EXPECT_FALSE(robot_.TakeHint());
  ScanAgain();
  const auto requests = Pushed<SessionRequest>();
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_EQ(requests[0].T_map_robot_start.x, 3.0);
}

TEST_F(InitialPose, TheNewestCounts) {
  Drive();
  SayWhereItIs(1.0);
  const auto first = robot_.TakeHint();
  ASSERT_TRUE(first);
  SayWhereItIs(1.5);
  SayWhereItIs(2.0);
  EXPECT_FALSE(robot_.TakeHint()) << "the first is not answered yet";
  robot_.TakeHintAnswer(first->number, kNotJoined);
  const auto second = robot_.TakeHint();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->request.T_map_robot->x, 2.0);
  ScanAgain();
  EXPECT_TRUE(robot_.open());
  EXPECT_TRUE(Pushed<SessionRequest>().empty());
  robot_.TakeHintAnswer(second->number, kNotJoined);
  ScanAgain();
  const auto requests = Pushed<SessionRequest>();
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_EQ(requests[0].T_map_robot_start.x, 2.0);
}

TEST_F(InitialPose, BeginsANewSessionAlsoWhereTheOldOneHasEndedMeanwhile) {
  Drive();
  SayWhereItIs(3.0);
  const auto hint = robot_.TakeHint();
  ASSERT_TRUE(hint);
  robot_.Take(State(SessionPhase::kEnded), now_);
  ScanAgain();
  EXPECT_TRUE(Pushed<SessionRequest>().empty());
  robot_.TakeHintAnswer(hint->number, {StatusCode::kFailedPrecondition, "the session has ended"});
  ScanAgain();
  const auto requests = Pushed<SessionRequest>();
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_TRUE(requests[0].has_start);
}

TEST_F(InitialPose, IsForgottenWhereTheSiteIsReset) {
  Drive();
  SayWhereItIs(3.0);
  const auto hint = robot_.TakeHint();
  ASSERT_TRUE(hint);
  robot_.BeginAnew();
  robot_.TakeHintAnswer(hint->number, kNotJoined);
  ScanAgain();
  const auto requests = Pushed<SessionRequest>();
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_FALSE(requests[0].has_start);
}

TEST_F(InitialPose, ThatTheServerDidNotTakeIsAProblemUntilTheNextOne) {
  Drive();
  SayWhereItIs(3.0);
  const auto hint = robot_.TakeHint();
  ASSERT_TRUE(hint);
  robot_.TakeHintAnswer(hint->number, {StatusCode::kResourceExhausted, "the server is busy"});
  EXPECT_TRUE(robot_.open());
  const auto failed = HasSubstr("its last initial pose was not used (the server is busy)");
  EXPECT_THAT(Problems(), Contains(failed));
  EXPECT_TRUE(robot_.IsOnMap(now_));
  SayWhereItIs(3.0);
  EXPECT_THAT(Problems(), Not(Contains(failed)));
  EXPECT_TRUE(robot_.TakeHint());
}

// The robot may have driven on since, where nobody could see it.
TEST_F(InitialPose, ThatCannotBeUsedSoonIsNotUsed) {
  Open();
  SayWhereItIs(3.0);
  static_cast<void>(Everything());
  now_ += std::chrono::seconds(30);
  ScanAgain();
  const auto requests = Pushed<SessionRequest>();
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_FALSE(requests[0].has_start);
}

TEST_F(InitialPose, ThatIsNoneIsIgnored) {
  Open();
  for (const bool used : {false, true}) {
    if (used) Pose();
    SayWhereItIs(3.0, "odom");
    SayWhereItIs(std::nan(""));
    EXPECT_TRUE(robot_.open());
    EXPECT_FALSE(robot_.TakeHint());
  }
}

}  // namespace
}  // namespace cairn::server
