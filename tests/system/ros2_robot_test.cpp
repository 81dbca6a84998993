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
#include "tests/temp_directory.h"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using Words = std::vector<std::string>;

class RosFleet : public ::testing::Test {
 protected:
  RosFleet() { setenv("CYCLONEDDS_URI", "file://" CAIRN_CYCLONE_CONFIG, 1); }
  void SetUp() override { StartServer({}); }

  void StartServer(const Words& settings) {
    Words line{CAIRND_PATH,
               "--domain",
               domain_,
               "--set",
               "ros2.enabled=true",
               "--set",
               "ros2.domain=" + domain_,
               "--set",
               "ros2.namespaces=/r2=yard/r2, /{robot}, /=rootless",
               "--set",
               "slam.particles=20"};
    for (const std::string& setting : settings) line.insert(line.end(), {"--set", setting});
    server_ = std::make_unique<ChildProcess>(line);
    EXPECT_TRUE(server_->Says("ready"));
  }
  void StartServerAnew(const Words& settings) {
    server_->Signal(SIGTERM);
    EXPECT_EQ(server_->Wait().exit_code, 0);
    StartServer(settings);
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
  static bool IsOnMap(const nlohmann::json& one) { return one["on_map"] == true; }
  // How many scans of the robot have arrived.
  static int ScansOf(const nlohmann::json& one) {
    for (const auto& topic : one["topics"])
      if (topic["name"] == one["name"].get<std::string>() + "/scan") return topic["received"].get<int>();
    return 0;
  }

  const std::string domain_ = std::to_string(test::TestDomain());
  std::unique_ptr<ChildProcess> server_;
};

TEST_F(RosFleet, RobotsAsTheyAreGetTheirPosesAndTheMap) {
  // They must still be there when the doctor is asked, which takes some seconds under a sanitizer.
  const auto humble = Robot("r1", "14");
  const auto jazzy = Robot("r2", "14", {"jazzy"}, "yard");  // In the other's map it would have to be joined first.
  EXPECT_EQ(DoctorOf("/r1", IsOnMap)["site"], "lab");
  EXPECT_EQ(DoctorOf("/r2", IsOnMap)["topics"].size(), 3U);
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

// A recording holds what they publish as if they were robots of Cairn's, and can be replayed as one.
TEST_F(RosFleet, ARecorderWritesDownTheirScansAndOdometry) {
  const TempDirectory directory;
  const std::string file = (directory / "fleet.mcap").string();
  ChildProcess recorder({CAIRN_PATH, "--domain", domain_, "record", file});
  const auto topic = Robot("r1", "100");
  const auto transform = Robot("r2", "100", {"tf-odom"}, "yard");
  const auto checked = [&](const std::string& robot) {
    const auto outcome =
        ChildProcess({CAIRN_PATH, "check-log", file, "--json", "--scan-topic", "/robots/" + robot + "/scan/scan"})
            .Wait();
    return nlohmann::json::parse(outcome.output, nullptr, false);
  };
  const auto count = [&](const std::string& robot, const char* what) {
    const nlohmann::json report = checked(robot);
    return report.is_object() && report.contains(what) ? report[what].value("count", 0) : 0;
  };
  for (const std::string robot : {"r1", "r2"}) {
    EXPECT_TRUE(test::Eventually([&] { return count(robot, "scans") > 20 && count(robot, "odometry") > 20; }))
        << robot << ": " << checked(robot);
  }
  recorder.Signal(SIGINT);
  const auto recorded = recorder.Wait();
  EXPECT_EQ(recorded.exit_code, 0) << recorded.output;
  EXPECT_THAT(recorded.output, HasSubstr("of r1, r2 in"));
  const nlohmann::json report = checked("r1");
  EXPECT_EQ(report["refused"].size(), 0U) << report;
  EXPECT_EQ(report["complaint_count"], 0) << report;
  const auto replayed = ChildProcess({CAIRN_PATH, "--domain", domain_, "replay", file, "--scan-topic",
                                      "/robots/r1/scan/scan", "--site", "again", "--robot", "copy", "--fast"})
                            .Wait();
  EXPECT_EQ(replayed.exit_code, 0) << replayed.output;
  EXPECT_THAT(replayed.output, HasSubstr("unexplained 0"));
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

// What does not keep a robot from the map is said as well.
TEST_F(RosFleet, TheDoctorSaysWhatElseIsWrong) {
  const auto beside = Robot("r1", "100", {"other-slam"});
  const auto late = Robot("r2", "100", {"late-odom", "shared-tf"}, "yard");
  const auto forgetful = Robot("r3", "100", {"volatile-tf", "shared-tf"});
  DoctorOf("/r1", [](const nlohmann::json& one) {
    return IsOnMap(one) && Says("another node also publishes map to odom")(one);
  });
  const auto printed = ChildProcess({CAIRN_PATH, "--domain", domain_, "ros2", "doctor", "r1"}).Wait();
  EXPECT_THAT(printed.output, HasSubstr("/r1  robot r1 in site lab: on the map, but:\n  - another node also"));
  DoctorOf("/r2", Says("apart: their clocks differ"));
  DoctorOf("/r3", Says("tf_static has a publisher whose durability is volatile"));
  std::string of_all;
  EXPECT_TRUE(test::Eventually([&] {
    of_all = Doctor()["problems"].dump();
    return of_all.find("two publishers contend for the frame 'base_footprint'") != std::string::npos &&
           of_all.find("another node also publishes /lab/map") != std::string::npos;
  })) << of_all;
}

// As RViz says it: "2D Pose Estimate".
TEST_F(RosFleet, AnInitialPoseLeavesTheSessionWhereTheServerCanLookForTheRobotThere) {
  // The second robot has to stay outside the map until it says where it is, and says so only roughly.
  StartServerAnew({"jobs.join=false", "jobs.check_starts=false"});
  const auto mapper = Robot("r1", "100", {"hint"});
  DoctorOf("/r1", IsOnMap);
  const auto stranger = Robot("r3", "100", {"hint"});
  DoctorOf("/r3", Says("nobody has said where it started"));
  const int before = ScansOf(DoctorOf("/r1", IsOnMap));
  mapper->Signal(SIGUSR1);
  EXPECT_TRUE(server_->Says("ROS 2: r1 is looked for where its initial pose says"));
  DoctorOf("/r1", [before](const nlohmann::json& one) { return IsOnMap(one) && ScansOf(one) > before + 50; });
  stranger->Signal(SIGUSR1);
  EXPECT_TRUE(server_->Says("ROS 2: r3 begins a new session at its initial pose"));
  DoctorOf("/r3", IsOnMap);
  server_->Signal(SIGTERM);
  const auto outcome = server_->Wait();
  EXPECT_EQ(outcome.exit_code, 0);
  const auto sessions = [&outcome](const std::string& robot) {
    const std::string line = "the session of " + robot + " in lab is opened";
    int count = 0;
    for (auto at = outcome.output.find(line); at != std::string::npos; at = outcome.output.find(line, at + 1)) ++count;
    return count;
  };
  EXPECT_EQ(sessions("r1"), 1) << outcome.output;
  EXPECT_EQ(sessions("r3"), 2) << outcome.output;
}

// Names that had come once kept others out until the server was started again.
TEST_F(RosFleet, NamespacesThatAreGoneMakeRoomForOthers) {
  StartServerAnew({"ros2.max_robots=1"});
  ExpectGood(*Robot("r1", "5"));
  // The first one does not say that it goes: its lease of 10 s has to end.
  const auto second = Robot("r2", "100", {}, "yard");
  DoctorOf("/r2", IsOnMap);
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
