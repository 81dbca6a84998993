// `cairn` against cairnd as a process, over real DDS on loopback: every subcommand that asks a server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <thread>

#include "common/map/occupancy_image.h"
#include "common/sensor/stamp.h"
#include "common/sensor/trajectory.h"
#include "tests/system/cli/cairn_program.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

TEST_F(CairnProgram, SaysWhenThereIsNoServer) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"ping"}, {"pose", "r"}, {"sim", "--site", "s"}, {"pose", "r", "--follow"}}) {
    const Outcome outcome = Cairn(arguments, "300ms");
    EXPECT_EQ(outcome.code, ExitCode::kFailed);
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

// The figures are measured once a second.
TEST_F(CairnProgram, TheStatusSaysHowBusyTheServerIs) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  EXPECT_THAT(Cairn({"status"}).out, ::testing::ContainsRegex("server: up [0-9]+ s, "));
  StreamFleet();
  nlohmann::json load;
  ASSERT_TRUE(test::Eventually([&] {
    load = MustJson({"status"})["load"];
    return load["commits"] > 0 && load["store_bytes"] > 0;
  })) << load;
  EXPECT_GT(load["memory_bytes"], 5'000'000);
  EXPECT_GT(load["processor_s"], 0.01);
  EXPECT_GT(load["up_s"], 1.0);
  EXPECT_EQ(load["failed_commits"], 0);
  EXPECT_GT(load["stored_after_p99_ms"], 0.0);
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

TEST_F(CairnProgram, AMapIsWatchedAndDrawnAsAnAnimation) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  const Outcome nowhere = Cairn({"map", "animate", "--site", "hall", "--seconds", "0", "-o", File("hall-grows.png")});
  EXPECT_EQ(nowhere.code, ExitCode::kFailed);
  EXPECT_THAT(nowhere.err, HasSubstr("hall"));
  EXPECT_FALSE(std::filesystem::exists(File("hall-grows.png")));
  StreamFleet();
  ASSERT_TRUE(test::Eventually([&] { return MustJson({"tiles", "--site", "hall"})["tiles"].size() > 4; }));
  // More looks than frames may be kept, and a robot that never comes.
  const auto grown = MustJson({"map", "animate", "--site", "hall", "--robots", "robot1", "nobody", "--every", "0.1",
                               "--seconds", "1", "--frames", "4", "-o", File("hall-grows.png")});
  EXPECT_GE(grown["frames"].get<int>(), 2);  // The first and the last.
  EXPECT_LE(grown["frames"].get<int>(), 4);
  EXPECT_EQ(grown["missed"].get<int>(), 0);
  EXPECT_EQ(grown["bytes"].get<std::uintmax_t>(), std::filesystem::file_size(File("hall-grows.png")));
  EXPECT_GT(grown["bytes"].get<std::uintmax_t>(), 10'000u);
}

TEST_F(CairnProgram, WhatPeopleSayAboutAMapIsInItsFilesUntilItIsTakenBack) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  StreamFleet();
  const auto cell_at = [&](const std::string& file, double x_m, double y_m) {
    const auto map = LoadMapYaml(File(file));
    if (!map) return -1;
    const auto column = static_cast<int>(std::floor((x_m - map->T_map_origin.x) / map->resolution_m));
    const auto row = static_cast<int>(std::floor((y_m - map->T_map_origin.y) / map->resolution_m));
    return static_cast<int>(map->cells.at(static_cast<std::size_t>(row * map->width + column)));
  };
  const std::vector<std::string> save = {"map", "export",          "--site",     "hall",
                                         "-o",  File("hall.yaml"), "--keep-out", File("mask.yaml")};
  const auto export_map = [&] { MustJson(save); };
  // Robot 1 begins here, so nothing stands here.
  constexpr double kX_m = 1.225, kY_m = 8.225;
  // At first there may be no tile yet.
  ASSERT_TRUE(
      test::Eventually([&] { return Cairn(save).code == ExitCode::kOk && cell_at("hall.yaml", kX_m, kY_m) == 0; }));
  const auto wall =
      MustJson({"map", "edit", "wall", "--site", "hall", "--line", "1,8.2", "1.5,8.2", "--note", "glass"});
  EXPECT_EQ(wall["kind"], "occupied");
  MustJson({"map", "edit", "keep-out", "--site", "hall", "--box", "2,8", "3,8.5"});
  export_map();
  EXPECT_EQ(cell_at("hall.yaml", kX_m, kY_m), 100);
  EXPECT_EQ(cell_at("mask.yaml", kX_m, kY_m), 0);
  const auto mask = LoadMapYaml(File("mask.yaml"));
  ASSERT_TRUE(mask);
  EXPECT_EQ(std::count(mask->cells.begin(), mask->cells.end(), 100), 200) << "a square metre has 400 cells";
  EXPECT_EQ(cell_at("mask.yaml", 2.5, 8.25), 100);

  // The building's x axis is the map's y axis.
  const std::vector<std::string> in_building = {"map", "export",           "--site",  "hall",
                                                "-o",  File("built.yaml"), "--frame", "building"};
  EXPECT_EQ(Cairn(in_building).code, ExitCode::kFailed) << "nobody has said where the building is";
  const auto origin = MustJson({"map", "edit", "origin", "--site", "hall", "--at", "1,8", "--x-axis", "1,9"});
  MustJson(in_building);
  EXPECT_EQ(cell_at("built.yaml", kY_m - 8.0, 1.0 - kX_m), 100) << "the wall";
  const auto path = MustJson({"path", "robot1"})["path"],
             moved = MustJson({"path", "robot1", "--frame", "building"})["path"];
  ASSERT_FALSE(path.empty());
  EXPECT_NEAR(moved[0]["pose"]["x"].get<double>(), path[0]["pose"]["y"].get<double>() - 8.0, 1e-6);
  EXPECT_NEAR(moved[0]["pose"]["y"].get<double>(), 1.0 - path[0]["pose"]["x"].get<double>(), 1e-6);
  MustJson({"map", "edit", "remove", "--site", "hall", "--id", std::to_string(origin["id"].get<int>())});

  const auto listed = MustJson({"map", "edit", "list", "--site", "hall"})["edits"];
  ASSERT_EQ(listed.size(), 2u);
  EXPECT_EQ(listed[0]["note"], "glass");
  MustJson({"map", "edit", "remove", "--site", "hall", "--id", std::to_string(wall["id"].get<int>())});
  export_map();
  EXPECT_EQ(cell_at("hall.yaml", kX_m, kY_m), 0);
  EXPECT_EQ(cell_at("mask.yaml", 2.5, 8.25), 100);
  EXPECT_EQ(Cairn({"map", "export", "--site", "hall", "-o", File("a.yaml"), "--keep-out", File("a.yml")}).code,
            ExitCode::kFailed)
      << "both would have the image a.png";
  EXPECT_EQ(Cairn({"map", "edit", "erase", "--site", "hall", "--box", "1500,1", "1501,2"}).code, ExitCode::kFailed);
  EXPECT_EQ(Cairn({"map", "edit", "erase", "--site", "hall", "--box", "1,1", "2,2", "--width", "1"}).code,
            ExitCode::kUsage);
  EXPECT_EQ(Cairn({"map", "edit", "erase", "--site", "hall"}).code, ExitCode::kUsage) << "where?";
  EXPECT_EQ(Cairn({"map", "edit", "erase", "--site", "hall", "--box", "1,1", "here"}).code, ExitCode::kUsage);
  EXPECT_EQ(Cairn({"map", "edit", "erase", "--site", "hall", "--box", "1,1", "1,1"}).code, ExitCode::kFailed);
}

// The furniture stands elsewhere in the second run.
TEST_F(CairnProgram, WhatChangedBetweenTwoRunsIsALayerOfTheMap) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  const auto drive = [&](const std::string& prefix, const std::string& furniture) {
    MustJson({"sim",
              "--robots",
              "1",
              "--prefix",
              prefix,
              "--world",
              "office",
              "--seconds",
              "30",
              "--fast",
              "--beams",
              "181",
              "--site",
              "hall",
              "--first-stamp",
              "1000",
              "--furniture",
              "20",
              "--furniture-seed",
              furniture});
  };
  drive("monday", "1");
  const std::vector<std::string> draw = {"map",     "draw",         "--site", "hall",
                                         "--layer", "disagreement", "-o",     File("d.png")};
  const Outcome alone = Cairn(draw);
  EXPECT_EQ(alone.code, ExitCode::kFailed);
  EXPECT_THAT(alone.err, HasSubstr("nobody disagrees"));
  drive("tuesday", "2");
  ASSERT_TRUE(test::Eventually([&] { return Cairn(draw).code == ExitCode::kOk; }));
  EXPECT_GT(std::filesystem::file_size(File("d.png")), 1000U);
  const auto tiles = MustJson({"tiles", "--site", "hall", "--disagreement", "--level", "3"});
  EXPECT_FALSE(tiles["tiles"].empty());
  const auto places = MustJson({"pose", "tuesday1", "--hypotheses"})["hypotheses"];
  ASSERT_FALSE(places.empty());
  double sum = 0.0;
  for (const auto& place : places) sum += place["weight"].get<double>();
  EXPECT_GT(sum, 0.9);
  EXPECT_LT(sum, 1.0 + 1e-9);
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
