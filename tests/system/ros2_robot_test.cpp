// ROS 2 robots, as rmw_cyclonedds puts them on the wire (tests/integration/cyclone/ros2_robot.c), against cairnd: good
// ones of both conventions get their poses and the map, and `cairn ros2 doctor` says of the others why they do not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/child_process.h"
#include "tests/loopback.h"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using Words = std::vector<std::string>;

class RosFleet : public ::testing::Test {
 protected:
  RosFleet() { setenv("CYCLONEDDS_URI", "file://" CAIRN_CYCLONE_CONFIG, 1); }
  void SetUp() override { StartServer("256"); }

  void StartServer(const std::string& max_robots) {
    server_ = std::make_unique<ChildProcess>(Words{CAIRND_PATH, "--domain", domain_, "--set", "ros2.enabled=true",
                                                   "--set", "ros2.domain=" + domain_, "--set",
                                                   "ros2.namespaces=/r2=yard/r2, /{robot}, /=rootless", "--set",
                                                   "slam.particles=20", "--set", "ros2.max_robots=" + max_robots});
    EXPECT_TRUE(server_->Says("ready"));
  }

  std::unique_ptr<ChildProcess> Robot(const std::string& name_space, const std::string& seconds, Words words = {},
                                      const std::string& site = "lab") {
    Words line{CAIRN_ROS2_ROBOT, domain_, name_space, site, seconds};
    line.insert(line.end(), words.begin(), words.end());
    return std::make_unique<ChildProcess>(line);
  }
  void ExpectGood(ChildProcess& robot) {
    const auto outcome = robot.Wait();
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    std::printf("%s", outcome.output.c_str());
  }
  nlohmann::json Doctor() {
    const auto outcome = ChildProcess({CAIRN_PATH, "--domain", domain_, "ros2", "doctor", "--json"}).Wait();
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    return nlohmann::json::parse(outcome.output, nullptr, false);
  }
  // What the doctor says of a namespace, once `good` holds for it.
  nlohmann::json DoctorOf(const std::string& name, const std::function<bool(const nlohmann::json&)>& good) {
    nlohmann::json found;
    const bool came = test::Eventually([&] {
      const nlohmann::json report = Doctor();
      for (const auto& one : report.at("namespaces")) {
        if (one["name"] == name) found = one;
      }
      return !found.is_null() && good(found);
    });
    EXPECT_TRUE(came) << name << ": " << found;
    return found;
  }
  static std::string ProblemsOf(const nlohmann::json& name_space) { return name_space["problems"].dump(); }
  static auto Says(const std::string& text) {
    return [text](const nlohmann::json& one) { return ProblemsOf(one).find(text) != std::string::npos; };
  }

  const std::string domain_ = std::to_string(test::TestDomain());
  std::unique_ptr<ChildProcess> server_;
};

TEST_F(RosFleet, RobotsAsTheyAreGetTheirPosesAndTheMap) {
  // They must still be there when the doctor is asked, which takes some seconds under a sanitizer.
  const auto humble = Robot("r1", "14");
  const auto jazzy = Robot("r2", "14", {"jazzy"}, "yard");  // In the other's map it would have to be joined first.
  const auto on_map = [](const nlohmann::json& one) { return one["on_map"] == true; };
  EXPECT_EQ(DoctorOf("/r1", on_map)["site"], "lab");
  EXPECT_EQ(DoctorOf("/r2", on_map)["topics"].size(), 3U);
  ExpectGood(*humble);
  ExpectGood(*jazzy);
  server_->Signal(SIGTERM);
  const auto outcome = server_->Wait();
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.output, HasSubstr("since the start: nothing")) << "every sample of theirs was taken";
}

TEST_F(RosFleet, OdometryAsATransformOfARobotWithoutNamespace) {
  const auto robot = Robot("-", "5", {"tf-odom"});
  ExpectGood(*robot);
}

TEST_F(RosFleet, TheDoctorSaysWhyARobotIsNotOnTheMap) {
  const auto unknown = Robot("fleet/hall/r3", "8");
  const auto unmounted = Robot("r4", "8", {"no-tf"});
  const auto blind = Robot("r5", "8", {"only-scan"});
  const auto nonsense = Robot("r6", "8", {"nonsense"});
  const nlohmann::json stranger = DoctorOf("/fleet/hall/r3", Says("no rule of ros2.namespaces fits it"));
  EXPECT_EQ(stranger["robot"], "");
  EXPECT_THAT(stranger["topics"].dump(), HasSubstr("sensor_msgs/msg/LaserScan"));
  DoctorOf("/r4", Says("no transform connects its frame 'laser_frame' with the robot's frame 'base_footprint'"));
  DoctorOf("/r5", Says("there is no odometry"));
  // 40,000 ranges, four seconds of nanoseconds: nothing of it reaches the rooms.
  const nlohmann::json wrong = DoctorOf("/r6", [](const nlohmann::json& one) {
    return one["topics"][0]["refused"] > 0 && one["topics"][1]["refused"] > 0;
  });
  EXPECT_FALSE(wrong["on_map"].get<bool>());
  // None of them got a pose, and a good one beside them does.
  ExpectGood(*Robot("r7", "5"));
  for (const auto* robot : {&unmounted, &blind, &nonsense}) ExpectGood(**robot);
  const auto doctor = ChildProcess({CAIRN_PATH, "--domain", domain_, "ros2", "doctor", "r4"}).Wait();
  EXPECT_THAT(doctor.output, HasSubstr("/r4  robot r4 in site lab: NOT on the map\n  - "));
  server_->Signal(SIGTERM);
  EXPECT_EQ(server_->Wait().exit_code, 0);
}

// Names that had come once kept others out until the server was started again.
TEST_F(RosFleet, NamespacesThatAreGoneMakeRoomForOthers) {
  server_->Signal(SIGTERM);
  EXPECT_EQ(server_->Wait().exit_code, 0);
  StartServer("1");
  ExpectGood(*Robot("r1", "5"));
  // The first one does not say that it goes: its lease of 10 s has to end.
  const auto second = Robot("r2", "100", {}, "yard");
  DoctorOf("/r2", [](const nlohmann::json& one) { return one["on_map"] == true; });
  EXPECT_EQ(Doctor()["namespaces"].size(), 1U);
}

TEST(Ros2Doctor, SaysThatTheDoorIsShut) {
  const std::string domain = std::to_string(test::TestDomain());
  ChildProcess server({CAIRND_PATH, "--domain", domain});
  const auto doctor = ChildProcess({CAIRN_PATH, "--domain", domain, "ros2", "doctor"}).Wait();
  EXPECT_NE(doctor.exit_code, 0);
  EXPECT_THAT(doctor.output, HasSubstr("ros2.enabled=true"));
}

}  // namespace
}  // namespace cairn
