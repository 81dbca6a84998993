// Services for ROS 2 programs against cairnd, called as rmw_cyclonedds does it
// (tests/integration/cyclone/ros2_caller.c), while a robot maps.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using Words = std::vector<std::string>;

class RosCallers : public ::testing::Test {
 protected:
  RosCallers() { setenv("CYCLONEDDS_URI", "file://" CAIRN_CYCLONE_CONFIG, 1); }

  void StartServer(const std::string& commands) {
    server_ = std::make_unique<ChildProcess>(Words{CAIRND_PATH, "--domain", domain_, "--state", state_.path().string(),
                                                   "--set", "ros2.enabled=true", "--set", "ros2.domain=" + domain_,
                                                   "--set", "ros2.commands=" + commands, "--set", "slam.particles=20"});
    EXPECT_TRUE(server_->Says("ready"));
  }
  // A robot that has drawn something of the site lab.
  std::unique_ptr<ChildProcess> RobotThatMaps(const std::string& seconds) {
    auto robot = std::make_unique<ChildProcess>(Words{CAIRN_ROS2_ROBOT, domain_, "r1", "lab", seconds});
    EXPECT_TRUE(MapIsDrawn());
    return robot;
  }
  ChildProcess::Outcome Caller(Words words) const {
    words.insert(words.begin(), {CAIRN_ROS2_CALLER, domain_});
    return ChildProcess(words).Wait();
  }
  nlohmann::json Call(const Words& words) const {
    const auto outcome = Caller(words);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
    return nlohmann::json::parse(outcome.output, nullptr, false);
  }
  // Calls again and again until the number in the answer is right. On a busy machine a call may get no answer in time.
  bool CallUntil(const Words& words, const std::string& member, const std::function<bool(int)>& right) const {
    return test::Eventually([&] {
      const nlohmann::json answer = nlohmann::json::parse(Caller(words).output, nullptr, false);
      return answer.contains(member) && right(answer[member].get<int>());
    });
  }
  bool MapIsDrawn() const {
    return CallUntil({"get_map", "/lab/map"}, "occupied", [](int cells) { return cells > 100; });
  }
  std::string Cairn(Words words) {
    words.insert(words.begin(), {CAIRN_PATH, "--domain", domain_});
    return ChildProcess(words).Wait().output;
  }
  bool IsSaved(const std::string& name) const { return std::filesystem::exists(state_ / "saved" / (name + ".site")); }
  void StopServer() {
    server_->Signal(SIGTERM);
    EXPECT_EQ(server_->Wait().exit_code, 0);
  }

  const std::string domain_ = std::to_string(test::TestDomain());
  const TempDirectory state_;
  std::unique_ptr<ChildProcess> server_;
};

TEST_F(RosCallers, GetTheMapInBothConventions) {
  StartServer("false");
  const auto robot = RobotThatMaps("30");
  for (const Words& convention : {Words{}, Words{"jazzy"}}) {
    for (const char* const service : {"/lab/dynamic_map", "/lab/map"}) {
      Words words{"get_map", service};
      words.insert(words.end(), convention.begin(), convention.end());
      const nlohmann::json map = Call(words);
      EXPECT_EQ(map["frame"], "map");
      EXPECT_EQ(map["whole"], true);
      EXPECT_GT(map["occupied"], 100);
      EXPECT_NEAR(map["resolution"].get<double>(), 0.05, 1e-6);
    }
  }
  // 300 requests at once do not keep the server from answering.
  EXPECT_GT(Call({"get_map", "/lab/map", "flood"})["occupied"], 100);
  // A program that asks before it knows who answers gets an answer once it asks again.
  EXPECT_GT(Call({"get_map", "/lab/map", "impatient"})["occupied"], 100);
  EXPECT_GT(Call({"get_map", "/lab/map"})["occupied"], 100);
  EXPECT_THAT(Cairn({"status"}), HasSubstr("r1"));
  StopServer();
}

TEST_F(RosCallers, SavePauseAndResetSitesWhereThatIsAllowed) {
  StartServer("true");
  const auto robot = RobotThatMaps("100");
  EXPECT_EQ(Call({"save_map", "/lab/save_map", "monday"})["result"], 0);
  EXPECT_EQ(Call({"serialize_map", "/lab/serialize_map", "graph", "jazzy"})["result"], 0);
  EXPECT_EQ(Call({"save_map", "/lab/save_map", "../monday"})["result"], 255) << "no path";
  EXPECT_EQ(Call({"serialize_map", "/lab/serialize_map", "/tmp/graph"})["result"], 255);
  EXPECT_TRUE(IsSaved("monday"));
  EXPECT_TRUE(IsSaved("graph"));

  // A robot maps again once it is found in the map. Until then the answer is 0, and nothing changes.
  const auto maps_again = [this] {
    return CallUntil({"pause", "/lab/pause_new_measurements", "jazzy"}, "result",
                     [](int result) { return result == 1; });
  };
  // Somebody else has paused it: the first call has it map again.
  EXPECT_THAT(Cairn({"robot", "localise", "r1"}), HasSubstr("only localised"));
  EXPECT_TRUE(maps_again()) << Cairn({"status"}) << Cairn({"ros2", "doctor"});
  EXPECT_TRUE(server_->Says("ROS 2: the robots of site lab map again"));
  EXPECT_EQ(Call({"pause", "/lab/pause_new_measurements"})["result"], 1);
  EXPECT_TRUE(server_->Says("ROS 2: the robots of site lab are only localised"));
  EXPECT_TRUE(maps_again()) << Cairn({"status"}) << Cairn({"ros2", "doctor"});

  EXPECT_EQ(Call({"load_map", "/cairn/load_map", "nothing"})["result"], 1);
  EXPECT_EQ(Call({"load_map", "/cairn/load_map", "/etc/passwd"})["result"], 1);
  EXPECT_EQ(Call({"load_map", "/cairn/load_map", "monday"})["result"], 255) << "there is a site lab already";

  EXPECT_EQ(Call({"reset", "/lab/reset", "true"})["result"], 255) << "nothing can be localised in an empty map";
  EXPECT_EQ(Call({"reset", "/lab/reset"})["result"], 0);
  // The robot maps again by itself, from its new beginning.
  EXPECT_TRUE(MapIsDrawn());
  StopServer();
}

TEST_F(RosCallers, LoadASavedSiteWithItsMap) {
  StartServer("true");
  {
    const auto robot = RobotThatMaps("60");
    EXPECT_EQ(Call({"save_map", "/lab/save_map", "monday"})["result"], 0);
  }
  Cairn({"session", "end", "r1"});
  EXPECT_TRUE(test::Eventually([this] {
    return ChildProcess({CAIRN_PATH, "--domain", domain_, "site", "delete", "lab"}).Wait().exit_code == 0;
  }));
  const nlohmann::json loaded = Call({"load_map", "/cairn/load_map", "monday", "jazzy"});
  EXPECT_EQ(loaded["result"], 0);
  EXPECT_GT(loaded["occupied"], 100);
  EXPECT_THAT(Cairn({"map", "info"}), HasSubstr("lab"));
  StopServer();
}

TEST_F(RosCallers, FindNoCommandsWhereTheyAreNotAllowed) {
  StartServer("false");
  const auto robot = RobotThatMaps("60");
  const auto outcome =
      ChildProcess({CAIRN_ROS2_CALLER, domain_, "save_map", "/lab/save_map", "monday", "briefly"}).Wait();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.output, HasSubstr("the service is not there"));
  EXPECT_FALSE(IsSaved("monday"));
  StopServer();
}

}  // namespace
}  // namespace cairn
