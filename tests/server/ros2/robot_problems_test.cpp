// Whether a ROS 2 robot is on the map, why not, and what else is wrong with it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/ros2/ros_robot.h"

namespace cairn::server {
namespace {

using std::chrono::seconds;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST_F(RosRobot, SaysWhatIsMissing) {
  EXPECT_THAT(Problems(), Contains(HasSubstr("none arrives")));
  Scan(1);
  EXPECT_THAT(Problems(), Contains(HasSubstr("the frame of the robot is not known yet")));
  EXPECT_THAT(Problems(), Contains(HasSubstr("odometry is published, but none arrives")));
  Odom(1);
  robot_.Tick(now_);
  EXPECT_THAT(Problems(), Contains(HasSubstr("no transform connects its frame 'laser'")));
  Mount();
  robot_.Tick(now_);
  EXPECT_THAT(Problems(), ElementsAre("its session is not open yet")) << "there is always a reason";
  Odom(100);  // Ten seconds beside the scans.
  Scan(2);
  EXPECT_THAT(Problems(), Contains(HasSubstr("their clocks differ")));
  now_ += seconds(3);
  EXPECT_THAT(Problems(), Contains(HasSubstr("no scan for 3.0 s")));
  EXPECT_FALSE(robot_.IsOnMap(now_));
}

TEST_F(RosRobot, IsOnTheMapWhileItIsLocalized) {
  Open();
  EXPECT_THAT(Problems(), ElementsAre(HasSubstr("no scan has been used yet")));
  EXPECT_FALSE(robot_.IsOnMap(now_));
  Pose();
  EXPECT_THAT(Problems(), IsEmpty());
  EXPECT_TRUE(robot_.IsOnMap(now_));
  Pose(false, PoseReason::kLost);
  EXPECT_THAT(Problems(), ElementsAre(HasSubstr("lost")));
  EXPECT_FALSE(robot_.IsOnMap(now_));
  Pose(false, PoseReason::kNotJoined);
  EXPECT_THAT(Problems(), ElementsAre(HasSubstr("it is not joined with the map of its site yet")));
  EXPECT_FALSE(robot_.IsOnMap(now_));
}

TEST_F(RosRobot, PosesOfAnotherSessionSayNothing) {
  Open();
  request_.session ^= 1;
  Pose();
  EXPECT_FALSE(robot_.IsOnMap(now_));
  EXPECT_THAT(Problems(), Contains(HasSubstr("no scan has been used yet")));
}

TEST_F(RosRobot, IsOnTheMapOnlyWhileScansArriveAndAreUsed) {
  Open();
  Pose();
  now_ += seconds(3);
  EXPECT_FALSE(robot_.IsOnMap(now_));
  Odom(2);
  Scan(2);
  EXPECT_TRUE(robot_.IsOnMap(now_));
  now_ += seconds(3);
  Odom(3);
  Scan(3);
  EXPECT_FALSE(robot_.IsOnMap(now_)) << "its last pose is old";
  EXPECT_THAT(Problems(), Contains(HasSubstr("no scan has been used for 6.0 s")));
  robot_.Take(State(SessionPhase::kEnded), now_);
  EXPECT_THAT(Problems(), Contains(HasSubstr("its session was ended")));
  EXPECT_FALSE(robot_.IsOnMap(now_));
}

TEST_F(RosRobot, MayBeOnTheMapAlthoughSomethingElseIsWrong) {
  Open();
  Pose();
  Odom(100);
  EXPECT_THAT(Problems(), ElementsAre(HasSubstr("their clocks differ")));
  EXPECT_TRUE(robot_.IsOnMap(now_));
}

TEST_F(RosRobot, ComparesItsStampsWithTheClockOfTheServer) {
  Open();
  Pose();
  clock_ = kStart + 12 * kNanosPerSecond + kNanosPerSecond / 10;
  EXPECT_THAT(Problems(), ElementsAre(HasSubstr("scan: its stamps are 12.0 s behind the clock of the server")));
  EXPECT_TRUE(robot_.IsOnMap(now_)) << "the map needs no common clock";
  clock_ = kStart - 12 * kNanosPerSecond + kNanosPerSecond / 10;
  EXPECT_THAT(Problems(), ElementsAre(HasSubstr("12.0 s ahead of the clock of the server")));
  // A scan that arrived a second ago may have a stamp that is as old.
  clock_ = kStart + 3 * kNanosPerSecond + kNanosPerSecond / 2;
  now_ += seconds(1);
  EXPECT_THAT(Problems(), IsEmpty());
}

TEST_F(RosRobot, IsToldThatItsDriverDoesNotSayWhenBeamsAreMeasured) {
  Open();
  Pose();
  EXPECT_THAT(Problems(), IsEmpty()) << "two rays";
  const auto doubt = HasSubstr("scan: time_increment is 0");
  const auto take = [this](std::size_t rays, double time_increment) {
    ros2::LaserScan message = ScanMessage(5, rays);
    message.time_increment = time_increment;
    robot_.Take("scan", std::move(message), {kLidar, 5}, now_);
  };
  take(60, 0.0);  // 6 rad.
  EXPECT_THAT(Problems(), ElementsAre(doubt));
  EXPECT_TRUE(robot_.IsOnMap(now_));
  take(60, 0.001);
  EXPECT_THAT(Problems(), IsEmpty());
  take(40, 0.0);
  EXPECT_THAT(Problems(), IsEmpty()) << "4 rad: it may look at all of it at once";
}

TEST_F(RosRobot, NoticesThatAnotherNodePublishesMapToOdom) {
  const auto beside = HasSubstr("another node also publishes map to odom (its localisation, such as AMCL");
  Open();
  Pose();
  robot_.SeeMapToOdom(Mounting("map", "odom"), false, kOther, now_);
  EXPECT_THAT(Problems({kLidar}), IsEmpty()) << "this server does it itself";
  EXPECT_THAT(Problems({kLidar, kOther}), ElementsAre(beside));
  EXPECT_TRUE(robot_.IsOnMap(now_));
  now_ += seconds(3);
  EXPECT_THAT(Problems({kOther}), Not(Contains(beside))) << "it has stopped";
  robot_.SeeMapToOdom(Mounting("map", "odom"), true, kOther, now_);
  now_ += seconds(3);
  EXPECT_THAT(Problems({kOther}), Contains(beside)) << "what is static is said once";
  EXPECT_THAT(Problems({}), Not(Contains(beside))) << "its publisher is gone";
}

TEST_F(RosRobot, OtherTransformsOfTheMapAreNotItsOwn) {
  Open();
  robot_.SeeMapToOdom(Mounting("map", "r2/odom"), false, kOther, now_);
  robot_.SeeMapToOdom(Mounting("odom", "base_link"), false, kOther, now_);
  EXPECT_THAT(Problems({kOther}), Not(Contains(HasSubstr("another node"))));
}

TEST_F(RosRobot, RemembersTheNewestPublishersOfMapToOdom) {
  Open();
  for (std::uint8_t writer = 10; writer < 100; ++writer) {
    now_ += std::chrono::milliseconds(1);
    robot_.SeeMapToOdom(Mounting("map", "odom"), false, {writer}, now_);
  }
  EXPECT_THAT(Problems({{10}}), Not(Contains(HasSubstr("another node"))));
  EXPECT_THAT(Problems({{99}}), Contains(HasSubstr("another node")));
}

}  // namespace
}  // namespace cairn::server
