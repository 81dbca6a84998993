// `cairn` against cairnd as a process, over real DDS on loopback: every subcommand that asks a server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <optional>
#include <sstream>
#include <thread>

#include "client/cli/program.h"
#include "common/map/occupancy_image.h"
#include "common/sensor/stamp.h"
#include "common/sensor/trajectory.h"
#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

struct Outcome {
  ExitCode code;
  std::string out;
  std::string err;

  [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(out); }
};

class CairnProgram : public ::testing::Test {
 protected:
  void StartServer() {
    server_.emplace(std::vector<std::string>{CAIRND_PATH, "--domain", std::to_string(test::TestDomain()), "--set",
                                             "slam.particles=20", "--log-level", "warn"});
    if (Cairn({"ping"}).code == ExitCode::kOk) return;
    server_->Signal(SIGKILL);
    FAIL() << "cairnd does not answer: " << server_->Wait().output;
  }

  // One command line, told the domain and to be patient with a busy machine.
  static Outcome Cairn(std::vector<std::string> arguments, const std::string& timeout = "20s") {
    arguments.insert(arguments.begin(), {"--domain", std::to_string(test::TestDomain()), "--timeout", timeout});
    std::ostringstream out, err;
    const ExitCode code = RunCairn(arguments, out, err);
    return {code, out.str(), err.str()};
  }
  static nlohmann::json MustJson(std::vector<std::string> arguments) {
    arguments.push_back("--json");
    const Outcome outcome = Cairn(std::move(arguments));
    EXPECT_EQ(outcome.code, ExitCode::kOk) << outcome.err;
    return outcome.out.empty() ? nlohmann::json() : outcome.json();
  }
  // Two robots, 10 s each, into site `hall`; the truth in truth/.
  nlohmann::json StreamFleet() {
    return MustJson({"sim", "--robots", "2", "--seconds", "10", "--fast", "--beams", "181", "--site", "hall",
                     "--first-stamp", "1000", "--truth-dir", File("truth")});
  }
  void WriteLog(const std::string& seconds) {
    MustJson({"sim", "--no-stream", "--robots", "1", "--seconds", seconds, "--beams", "181", "--fov", "180",
              "--first-stamp", "1000", "--log-dir", File("")});
  }
  [[nodiscard]] std::string File(const std::string& name) const { return (directory_ / name).string(); }

  TempDirectory directory_;
  std::optional<ChildProcess> server_;
};

TEST_F(CairnProgram, SaysWhenThereIsNoServer) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"ping"}, {"pose", "r"}, {"sim", "--site", "s"}, {"pose", "r", "--follow"}}) {
    const Outcome outcome = Cairn(arguments, "300ms");
    EXPECT_EQ(outcome.code, ExitCode::kFailed);
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST_F(CairnProgram, ARobotThatNodsIsMappedAndItsCloudLiesOnTheWalls) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  const auto sim =
      MustJson({"sim",  "--robots",      "1",      "--world",         "hall3d",      "--seconds", "14",     "--hz",
                "5",    "--laser-model", "lms200", "--nod=-60,40,20", "--nod-every", "30",        "--fast", "--site",
                "hall", "--first-stamp", "1000",   "--log-dir",       File("")});
  EXPECT_EQ(sim["robots"][0]["unexplained"], 0);
  EXPECT_EQ(sim["robots"][0]["used"], 70) << "tilted scans are used too: they get poses";
  const auto cloud = MustJson({"cloud", "export", File("robot1.log"), "--robot", "robot1", "--height", "0.4", "-o",
                               File("hall.ply"), "--truth-world", "hall3d"});
  EXPECT_EQ(cloud["scans_without_pose"], 0);
  EXPECT_GE(cloud["scans_tilted"], 20);
  EXPECT_LT(cloud["wall_error_m"]["mean"], 0.02);
}

TEST_F(CairnProgram, AFleetIsMappedAndEveryScanExplained) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  const auto report = StreamFleet();
  for (const auto& robot : report["robots"]) {
    EXPECT_EQ(robot["sent"], 100);
    EXPECT_EQ(robot["used"], 100);
    EXPECT_EQ(robot["unexplained"], 0);
  }
  const auto status = MustJson({"status", "robot2"});
  ASSERT_EQ(status["robots"].size(), 1u);
  EXPECT_EQ(status["robots"][0]["ledgers"][0]["used"], 100);

  const auto truth = ReadTum(File("truth/robot1.tum"));
  ASSERT_TRUE(truth);
  const auto pose = MustJson({"pose", "robot1", "--at", FormatStamp((*truth)[50].stamp)});
  EXPECT_NEAR(pose["pose"]["x"].get<double>(), (*truth)[50].T_map_robot.x, 0.5);
  EXPECT_NEAR(pose["pose"]["y"].get<double>(), (*truth)[50].T_map_robot.y, 0.5);
  EXPECT_EQ(MustJson({"pose", "robot1"})["stamp"], truth->back().stamp);

  MustJson({"path", "robot1", "-o", File("robot1.tum")});
  const auto path = ReadTum(File("robot1.tum"));
  ASSERT_TRUE(path);
  EXPECT_EQ(path->size(), 100u);
  EXPECT_EQ(Cairn({"eval", File("robot1.tum"), File("truth/robot1.tum"), "--max-rmse", "0.3"}).code, ExitCode::kOk);
}

TEST_F(CairnProgram, TheMapComesAsTilesFilesAndPicture) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  StreamFleet();
  // The map is published a few times a second; wait until the last scans are in it and no version comes any more.
  nlohmann::json all, none;
  EXPECT_TRUE(test::Eventually([&] {
    const auto before = MustJson({"map", "info", "--site", "hall"})["maps"][0];
    all = MustJson({"tiles", "--site", "hall", "-o", File("tiles")});
    none =
        MustJson({"tiles", "--site", "hall", "--since-generation", std::to_string(all["generation"].get<Generation>()),
                  "--since-epoch", std::to_string(all["map_epoch"].get<int>()), "--since-version",
                  std::to_string(all["map_version"].get<int>())});
    return before["tile_count"] > 4 && all["tiles"].size() == before["tile_count"] &&
           all["map_version"] == before["version"] && none["map_version"] == all["map_version"];
  }));
  EXPECT_EQ(none["tiles"].size(), 0u);
  EXPECT_TRUE(std::filesystem::exists(File("tiles/L0_0_0.png")));
  EXPECT_LT(MustJson({"tiles", "--site", "hall", "--level", "2"})["tiles"].size(), all["tiles"].size());
  EXPECT_LT(MustJson({"tiles", "--site", "hall", "--area", "0.1,0.1,6,6"})["tiles"].size(), all["tiles"].size());

  const auto exported = MustJson({"map", "export", "--site", "hall", "-o", File("hall.yaml"), "--image", "pgm"});
  const auto map = LoadMapYaml(File("hall.yaml"));
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_EQ(map->width, exported["width"]);
  EXPECT_GT(std::count(map->cells.begin(), map->cells.end(), 0), 10'000) << "free cells";
  EXPECT_GT(std::count(map->cells.begin(), map->cells.end(), 100), 300) << "walls";
  MustJson({"map", "draw", "--site", "hall", "--robots", "robot1", "robot2", "-o", File("hall-picture.png")});
  EXPECT_GT(std::filesystem::file_size(File("hall-picture.png")), 10'000u);
}

TEST_F(CairnProgram, AReplayAsFastAsTheServerTakesItLosesNothing) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("30");
  const auto account =
      MustJson({"replay", File("robot1.log"), "--site", "hall", "--robot", "r1", "--fast", "--start", "1.2,8.2,0deg"});
  EXPECT_EQ(account["sent"], 300);
  EXPECT_EQ(account["used"], 300);
  EXPECT_EQ(account["dropped_total"], 0);
  EXPECT_EQ(account["unexplained"], 0);
  EXPECT_EQ(MustJson({"robot", "relocalise", "r1", "--here", "1.2,8.2,90deg"})["accepted"], true);
}

TEST_F(CairnProgram, AnEndedSessionCanBeReplayedAgainAndAResumedOneTakesTheClockAsSetBack) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("5");
  const std::vector<std::string> replay = {"replay", File("robot1.log"), "--site", "hall", "--robot", "r1", "--fast"};
  auto and_end = replay;
  and_end.push_back("--end");
  EXPECT_EQ(MustJson(and_end)["used"], 50);
  EXPECT_EQ(MustJson(replay)["used"], 50) << "a new session";
  const auto again = MustJson(replay);
  // The same stamps in the same session look like a clock that was set back: the first ones are dropped, and the others
  // are used. How many are dropped depends on how the two streams interleave.
  EXPECT_GE(again["dropped_total"], 4);
  EXPECT_GE(again["used"], 5);
  EXPECT_EQ(again["used"].get<int>() + again["dropped_total"].get<int>(), 50);
  EXPECT_EQ(again["unexplained"], 0);
  MustJson({"session", "end", "r1"});
  EXPECT_EQ(MustJson({"status", "r1"})["robots"][0]["phase"], "ended");
}

TEST_F(CairnProgram, SmoothingMakesAVersionThatCanBeRolledBack) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  StreamFleet();
  const auto job = MustJson({"job", "smooth", "--site", "hall", "--wait"});
  EXPECT_EQ(job["state"], "succeeded");
  const auto smoothed = MustJson({"path", "robot1", "--smoothed"});
  EXPECT_GT(smoothed["poses"], 10);
  const auto info = MustJson({"map", "info", "--site", "hall"})["maps"][0];
  EXPECT_EQ(info["enabled_version"], job["map_version"]);
  const auto back = MustJson({"map", "rollback", "--site", "hall"});
  EXPECT_EQ(back["enabled_version"], 1);
  EXPECT_GT(back["epoch"], info["epoch"]);
  EXPECT_EQ(Cairn({"map", "rollback", "--site", "hall"}).code, ExitCode::kFailed) << "nothing before the first";
  const std::string version = std::to_string(job["map_version"].get<int>());
  EXPECT_EQ(MustJson({"map", "enable", "--site", "hall", "--version", version})["enabled_version"], job["map_version"]);
  const std::string id = std::to_string(job["id"].get<int>());
  EXPECT_EQ(MustJson({"job", "list"})["jobs"].size(), 1u);
  EXPECT_EQ(MustJson({"job", "show", id})["jobs"][0]["state"], "succeeded");
}

TEST_F(CairnProgram, FollowPrintsPosesAsTheyCome) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  Outcome followed{ExitCode::kFailed, "", ""};
  std::thread follower([&] { followed = Cairn({"pose", "robot1", "--follow", "--count", "5", "--json"}); });
  // Real time, so that poses keep coming until the follower has found the server.
  const Outcome sim = Cairn({"sim", "--robots", "1", "--seconds", "8", "--beams", "91", "--site", "hall"});
  follower.join();
  EXPECT_EQ(sim.code, ExitCode::kOk) << sim.err;
  EXPECT_THAT(sim.out, HasSubstr("scan published to pose received p50"));
  EXPECT_EQ(followed.code, ExitCode::kOk) << followed.err;
  std::istringstream lines(followed.out);
  int poses = 0;
  for (std::string line; std::getline(lines, line); ++poses) {
    EXPECT_EQ(nlohmann::json::parse(line)["robot"], "robot1");
  }
  EXPECT_EQ(poses, 5);
}

TEST_F(CairnProgram, WhatTheServerDoesNotKnowFailsWithItsReason) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  const std::vector<std::pair<std::vector<std::string>, std::string>> unknown = {
      {{"pose", "nobody"}, "NOT_FOUND"},
      {{"path", "nobody"}, "NOT_FOUND"},
      {{"map", "export", "--site", "nowhere", "-o", File("x.yaml")}, "NOT_FOUND"},
      {{"tiles", "--site", "nowhere"}, "NOT_FOUND"},
      {{"job", "show", "99"}, "NOT_FOUND"},
      {{"job", "cancel", "99"}, "NOT_FOUND"},
      {{"job", "smooth", "--site", "nowhere"}, "NOT_FOUND"},
      {{"robot", "relocalise", "nobody"}, "NOT_FOUND"},
      {{"session", "end", "nobody"}, "NOT_FOUND"}};
  for (const auto& [arguments, code] : unknown) {
    const Outcome outcome = Cairn(arguments);
    EXPECT_EQ(outcome.code, ExitCode::kFailed) << arguments[0];
    EXPECT_THAT(outcome.err, HasSubstr(code)) << arguments[0];
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST_F(CairnProgram, AServerThatDiesWhileStreamingIsAClearError) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("200");
  std::optional<Outcome> replayed;
  std::thread replay([&] {
    replayed = Cairn({"replay", File("robot1.log"), "--site", "hall", "--robot", "r1", "--rate", "20"}, "3s");
  });
  ASSERT_TRUE(test::Eventually([] { return Cairn({"pose", "r1"}, "1s").code == ExitCode::kOk; }));
  server_->Signal(SIGKILL);
  server_->Wait();
  replay.join();
  EXPECT_EQ(replayed->code, ExitCode::kFailed) << replayed->out;
  EXPECT_THAT(replayed->err, HasSubstr("UNAVAILABLE"));
}

// It went on streaming to nobody, at the log's own pace.
TEST_F(CairnProgram, AServerThatIsStoppedEndsAReplayAtOnceWithAReason) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("200");
  std::optional<Outcome> replayed;
  std::thread replay([&] {
    replayed = Cairn({"replay", File("robot1.log"), "--site", "hall", "--robot", "r1", "--rate", "2"}, "3s");
  });
  ASSERT_TRUE(test::Eventually([] { return Cairn({"pose", "r1"}, "1s").code == ExitCode::kOk; }));
  const auto stopped = std::chrono::steady_clock::now();
  server_->Signal(SIGTERM);
  server_->Wait();
  replay.join();
  EXPECT_EQ(replayed->code, ExitCode::kFailed) << replayed->out;
  EXPECT_THAT(replayed->err, HasSubstr("the server is stopping"));
  // The log has 100 s to go.
  EXPECT_LT(std::chrono::steady_clock::now() - stopped, std::chrono::seconds(30));
}

TEST_F(CairnProgram, ASecondServerOfTheDomainIsRefused) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  const auto second = ChildProcess({CAIRND_PATH, "--domain", std::to_string(test::TestDomain())}).Wait();
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_THAT(second.output, HasSubstr("another server serves DDS domain"));
  EXPECT_EQ(Cairn({"ping"}, "5s").code, ExitCode::kOk);
}

TEST_F(CairnProgram, NumbersThatAreNoneAreUsageErrors) {
  EXPECT_EQ(Cairn({"sim", "--no-stream", "--seconds", "nan"}, "1s").code, ExitCode::kUsage);
  EXPECT_EQ(Cairn({"replay", "x.log", "--site", "hall", "--robot", "r1", "--rate", "nan"}, "1s").code,
            ExitCode::kUsage);
}

}  // namespace
}  // namespace cairn::client
