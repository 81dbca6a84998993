// A ROS 2 robot at the door: what reaches the server of its scans, odometry and transforms.
#include "server/ros2/robot_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/ros2/ros_robot.h"

namespace cairn::server {
namespace {

using std::chrono::seconds;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(RosRobot, BeginsAnewWhenItsSiteWasReset) {
  Open();
  const SessionRequest first = request_;
  robot_.BeginAnew();
  Odom(2);
  Scan(2);
  const auto requests = Pushed<SessionRequest>();
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_NE(requests[0].session, first.session);
  EXPECT_NE(requests[0].client, first.client);
  // The end of the first session may be told late.
  robot_.Take(State(SessionPhase::kEnded), now_);
  EXPECT_TRUE(robot_.open());
}

TEST_F(RosRobot, OpensItsSessionWithTheFirstScanThatIsComplete) {
  Odom(1, 0.5);
  Scan(1);
  EXPECT_EQ(inbound_.size(), 0U) << "it is not known yet how the lidar is mounted";
  Mount();
  Scan(2);
  const std::vector<InboundValue> values = Everything();
  ASSERT_EQ(values.size(), 3U);
  const auto& request = std::get<SessionRequest>(values[0]);
  EXPECT_EQ(request.robot, "r1");
  EXPECT_EQ(request.site, "lab");
  EXPECT_EQ(request.sensors, std::vector<std::string>{"scan"});
  EXPECT_FALSE(request.has_start);
  EXPECT_NE(request.client, 0U);
  // The odometry before the session comes behind the request, and then the scan.
  const auto& odometry = std::get<OdometryArrival>(values[1]);
  EXPECT_EQ(odometry.odometry.sequence, 1U);
  EXPECT_EQ(odometry.odometry.T_odom_robot.x, 0.5);
  EXPECT_EQ(odometry.stream.sensor_id, HashName("odometry"));
  const auto& scan = std::get<ScanArrival>(values[2]);
  EXPECT_FALSE(scan.refused);
  EXPECT_EQ(scan.scan->sequence, 1U);
  EXPECT_EQ(scan.scan->stamp, kStart + 200'000'000);
  EXPECT_NEAR(scan.scan->T_robot_laser.x, 0.2, 1e-12);
  EXPECT_EQ(scan.stream.session, request.session);
  EXPECT_EQ(scan.stream.robot_id, HashName("r1"));
}

TEST_F(RosRobot, NumbersItsSamplesAndLeavesOutWhatTheWireLost) {
  Open();
  Scan(2);
  Scan(5);          // 3 and 4 were lost.
  Scan(1, kOther);  // The driver was started again: its numbers begin anew, and nothing was lost.
  const auto scans = Pushed<ScanArrival>();
  ASSERT_EQ(scans.size(), 3U);
  EXPECT_EQ(scans[0].scan->sequence, 2U);
  EXPECT_EQ(scans[1].scan->sequence, 5U);
  EXPECT_EQ(scans[2].scan->sequence, 6U);
}

TEST_F(RosRobot, AScanOfALidarWhosePlaceIsUnknownIsCountedAsRefused) {
  Open();
  ros2::LaserScan message;
  message.header = {kStart, "unknown_frame"};
  message.angle_increment = 0.1;
  message.range_max = 10.0;
  message.ranges = {1.0F, 2.0F};
  robot_.Take("scan", std::move(message), {kLidar, 2}, now_);
  const auto scans = Pushed<ScanArrival>();
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_EQ(scans[0].refused, DropReason::kBadGeometry);
  EXPECT_EQ(scans[0].scan->sequence, 2U);
  EXPECT_THAT(Problems(), Contains(HasSubstr("'unknown_frame'")));
}

TEST_F(RosRobot, ASecondLidarJoinsTheSession) {
  Open();
  Scan(1, kOther, "rear/scan");
  const std::vector<InboundValue> values = Everything();
  ASSERT_EQ(values.size(), 2U);
  const auto& request = std::get<SessionRequest>(values[0]);
  EXPECT_EQ(request.session, request_.session);
  EXPECT_EQ(request.sensors, (std::vector<std::string>{"rear.scan", "scan"}));
  EXPECT_EQ(std::get<ScanArrival>(values[1]).stream.sensor_id, HashName("rear.scan"));
  EXPECT_EQ(std::get<ScanArrival>(values[1]).scan->sequence, 1U);
}

TEST_F(RosRobot, OdometryMayComeAsATransform) {
  robot_.SetPublishers(true, false, now_);
  robot_.Take(Mounting("odom", "base_link"), {kBase, 1}, now_);
  Mount();
  Scan(1);
  const auto odometry = Pushed<OdometryArrival>();
  ASSERT_EQ(odometry.size(), 1U);
  EXPECT_NEAR(odometry[0].odometry.T_odom_robot.x, 0.2, 1e-12);
  EXPECT_EQ(robot_.odom_frame(), "odom");
}

// On the shared tf the frames of a fleet begin with the names of its robots; frames without may be anybody's.
TEST_F(RosRobot, OfTheSharedTransformsOnlyItsOwnFramesAreItsOdometry) {
  robot_.SetPublishers(true, false, now_);
  Mount();
  robot_.TakeShared(Mounting("odom", "base_link"), false, {kBase, 1}, now_);
  robot_.TakeShared(Mounting("r2/odom", "r2/base_link"), false, {kBase, 2}, now_);
  Scan(1);
  EXPECT_EQ(inbound_.size(), 0U);
  EXPECT_THAT(Problems(), Contains(HasSubstr("there is no odometry")));
  robot_.TakeShared(Mounting("r1/odom", "r1/base_link"), false, {kBase, 3}, now_);
  EXPECT_EQ(robot_.odom_frame(), "r1/odom");
}

TEST_F(RosRobot, WithoutOdometryItIsFollowedByItsScansAlone) {
  robot_.SetPublishers(true, false, now_);
  robot_.Take(Mounting("base_footprint"), {kStatic, 1}, now_);
  Scan(1);
  now_ += seconds(4);
  Scan(2);
  EXPECT_EQ(inbound_.size(), 0U) << "odometry may come";
  EXPECT_THAT(Problems(), Not(Contains(HasSubstr("scans alone"))));
  now_ += seconds(1);
  Scan(3);
  const std::vector<InboundValue> values = Everything();
  ASSERT_EQ(values.size(), 2U);
  EXPECT_TRUE(std::holds_alternative<SessionRequest>(values[0]));
  EXPECT_NEAR(std::get<ScanArrival>(values[1]).scan->T_robot_laser.x, 0.2, 1e-12);
  EXPECT_EQ(robot_.odom_frame(), "base_footprint");
  EXPECT_THAT(Problems(), Contains(HasSubstr("scans alone")));
  // It begins after all.
  Odom(4);
  EXPECT_EQ(robot_.odom_frame(), "odom");
  EXPECT_EQ(Pushed<OdometryArrival>().size(), 1U);
}

TEST_F(RosRobot, OdometryThatIsPublishedIsWaitedFor) {
  Mount();
  Scan(1);
  now_ += seconds(60);
  Scan(2);
  EXPECT_EQ(inbound_.size(), 0U);
}

TEST_F(RosRobot, TriesAgainWhereItIsRefused) {
  Open();
  robot_.Take(Refusal(StatusCode::kAlreadyExists, "another live client streams as 'r1'"), now_);
  EXPECT_FALSE(robot_.open());
  Scan(2);
  EXPECT_EQ(inbound_.size(), 0U) << "samples of a refused session would only be counted";
  EXPECT_THAT(Problems(), Contains(HasSubstr("another live client")));
  now_ += seconds(6);
  Odom(3);
  Scan(3);
  const auto requests = Pushed<SessionRequest>();
  ASSERT_EQ(requests.size(), 1U);
  EXPECT_NE(requests[0].session, request_.session);
}

TEST_F(RosRobot, ARefusalOfAnotherSessionIsNotItsOwn) {
  Open();
  SessionRefusal refusal = Refusal(StatusCode::kAlreadyExists, "no");
  refusal.state.session ^= 1;
  robot_.Take(refusal, now_);
  EXPECT_TRUE(robot_.open());
}

TEST_F(RosRobot, ASessionThatSomebodyEndedStaysEndedUntilTheRobotIsStartedAgain) {
  Open();
  robot_.Take(State(SessionPhase::kEnded), now_);
  now_ += seconds(10);
  Odom(2);
  Scan(2);
  EXPECT_TRUE(Pushed<SessionRequest>().empty());
  EXPECT_THAT(Problems(), Contains(HasSubstr("its session was ended")));
  robot_.SetPublishers(false, false, now_);
  robot_.SetPublishers(true, true, now_);
  Odom(3);
  Scan(3);
  EXPECT_EQ(Pushed<SessionRequest>().size(), 1U);
}

TEST_F(RosRobot, IsAwayWhileNobodyPublishesItsScans) {
  Open();
  robot_.SetPublishers(false, true, now_);
  robot_.SetPublishers(false, false, now_);
  const auto gone = Pushed<ClientLiveliness>();
  ASSERT_EQ(gone.size(), 1U);
  EXPECT_FALSE(gone[0].alive);
  EXPECT_EQ(gone[0].client, request_.client);
  robot_.SetPublishers(true, true, now_);
  const auto returned = Pushed<ClientLiveliness>();
  ASSERT_EQ(returned.size(), 1U);
  EXPECT_TRUE(returned[0].alive);
  EXPECT_TRUE(robot_.open());
}

TEST_F(RosRobot, RefusesOdometryThatIsNoPose) {
  Open();
  ros2::Odometry message;
  message.header = {kStart, "odom"};
  message.child_frame = "base_link";
  message.pose.rotation.coeffs().setZero();
  robot_.Take(std::move(message), {kBase, 2}, now_);
  EXPECT_EQ(inbound_.size(), 0U);
  EXPECT_THAT(Problems(), Contains(HasSubstr("its odometry is refused")));
  Odom(3);
  EXPECT_THAT(Problems(), Not(Contains(HasSubstr("its odometry is refused"))));
}

TEST_F(RosRobot, CountsWhatTheFullChannelDidNotTake) {
  Open();
  for (int i = 2; i < 100; ++i) Odom(i);
  EXPECT_EQ(robot_.overflow(), 98U - 64U);
}

}  // namespace
}  // namespace cairn::server
