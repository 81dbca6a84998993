// `cairn eval --map-entropy`: trajectories of a simulated robot, the true one and worse ones, by the maps they make.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>
#include <utility>

#include "client/cli/program.h"
#include "common/sensor/trajectory.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

struct EvalOutcome {
  ExitCode code;
  std::string out;
  std::string err;
};

class MapEntropyCommand : public ::testing::Test {
 protected:
  static EvalOutcome Cairn(const std::vector<std::string>& arguments) {
    std::ostringstream out, err;
    const ExitCode code = RunCairn(arguments, out, err);
    return {code, out.str(), err.str()};
  }
  // 20 s of one robot: log/robot1.log and truth/robot1.tum.
  void Simulate(std::vector<std::string> options) {
    options.insert(options.begin(), {"sim", "--no-stream", "--robots", "1", "--seconds", "20", "--first-stamp", "1000",
                                     "--log-dir", File("log"), "--truth-dir", File("truth")});
    ASSERT_EQ(Cairn(options).code, ExitCode::kOk);
  }
  // What is measured of one trajectory, or of the odometry.
  nlohmann::json Measure(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"eval", "--json", "--map-entropy", log_});
    const EvalOutcome outcome = Cairn(arguments);
    EXPECT_EQ(outcome.code, ExitCode::kOk) << outcome.err;
    return outcome.code == ExitCode::kOk ? nlohmann::json::parse(outcome.out)["trajectories"][0] : nlohmann::json();
  }
  // The truth, moved by 5 cm to and fro from pose to pose.
  std::string Blurred() {
    auto path = ReadTum(truth_);
    EXPECT_TRUE(path);
    for (std::size_t i = 0; path && i < path->size(); ++i) {
      const double shift_m = i % 2 == 0 ? 0.05 : -0.05;
      (*path)[i].T_map_robot.x += shift_m;
      (*path)[i].T_map_robot.y += shift_m;
    }
    EXPECT_TRUE(WriteTum(*path, File("blurred.tum")));
    return File("blurred.tum");
  }
  [[nodiscard]] std::string File(const std::string& name) const { return (directory_ / name).string(); }

  TempDirectory directory_;
  const std::string log_ = File("log/robot1.log"), truth_ = File("truth/robot1.tum");
};

TEST_F(MapEntropyCommand, TheTrueTrajectoryMakesACrisperMapThanABlurredOne) {
  Simulate({"--beams", "181", "--fov", "180"});
  const auto truth = Measure({truth_}), blurred = Measure({Blurred()});
  EXPECT_EQ(truth["trajectory"], truth_);
  EXPECT_EQ(truth["scans"], 200);
  EXPECT_EQ(truth["scans_left_out"], 0);
  EXPECT_LT(truth["mean_map_entropy"].get<double>(), -2.8);
  EXPECT_GT(blurred["mean_map_entropy"].get<double>(), truth["mean_map_entropy"].get<double>() + 0.7);
  EXPECT_NEAR(truth["thickness_m"].get<double>(), 0.0144, 0.003);
  EXPECT_NEAR(blurred["thickness_m"].get<double>(), 0.052, 0.008);
  EXPECT_GT(truth["points"], 20'000);
  // With coarser squares there are fewer points.
  EXPECT_LT(Measure({truth_, "--spacing", "0.02"})["points"], truth["points"].get<int>() / 2);
  EXPECT_LT(Measure({truth_, "--max-range", "2"})["points"], truth["points"].get<int>() / 2);
  EXPECT_NE(Measure({truth_, "--radius", "0.15"})["mean_map_entropy"], truth["mean_map_entropy"]);
}

TEST_F(MapEntropyCommand, ComparesSeveralInOneTableAndTakesTheOdometryWithoutAny) {
  Simulate({"--beams", "181", "--fov", "180"});
  const EvalOutcome table = Cairn({"eval", "--map-entropy", log_, truth_, Blurred()});
  ASSERT_EQ(table.code, ExitCode::kOk) << table.err;
  EXPECT_EQ(std::count(table.out.begin(), table.out.end(), '\n'), 3);
  EXPECT_THAT(table.out, HasSubstr("ENTROPY  THICKNESS (mm)"));
  EXPECT_LT(table.out.find("\n" + truth_), table.out.find("\n" + File("blurred.tum")));
  const auto odometry = Measure({});
  EXPECT_EQ(odometry["trajectory"], "odometry");
  EXPECT_GT(odometry["scans"], 190);
}

// The robot drives and turns while the lidar turns once in 0.1 s, and the log says so.
TEST_F(MapEntropyCommand, BeamsAreWhereTheRobotWasWhenTheyWereMeasured) {
  Simulate({"--beams", "360", "--fov", "359", "--sweep", "0.1"});
  const auto timed = Measure({truth_}), at_once = Measure({truth_, "--scan-period", "0"});
  EXPECT_LT(timed["thickness_m"].get<double>(), 0.02);
  EXPECT_GT(at_once["thickness_m"].get<double>(), 0.04);
}

TEST_F(MapEntropyCommand, WhatCannotBeMeasuredIsAnErrorOfOneLine) {
  Simulate({"--beams", "181", "--fov", "180"});
  ASSERT_TRUE(WriteTum({{1, {0, 0, 0}}, {2, {1, 0, 0}}}, File("other_time.tum")));
  const std::vector<std::pair<std::vector<std::string>, std::string>> failing = {
      {{"eval", "--map-entropy", File("none.log")}, "none.log"},
      {{"eval", "--map-entropy", log_, File("none.tum")}, "none.tum"},
      {{"eval", "--map-entropy", log_, truth_, File("other_time.tum")}, "no scan has a pose"}};
  for (const auto& [arguments, why] : failing) {
    const EvalOutcome outcome = Cairn(arguments);
    EXPECT_EQ(outcome.code, ExitCode::kFailed);
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
  const std::vector<std::vector<std::string>> wrong = {{"eval"},
                                                       {"eval", truth_},
                                                       {"eval", truth_, truth_, truth_},
                                                       {"eval", truth_, truth_, "--radius", "0.3"},
                                                       {"eval", "--map-entropy", log_, "--radius", "0"},
                                                       {"eval", "--map-entropy", log_, "--spacing", "nan"},
                                                       {"eval", "--map-entropy", log_, "--align", "se2"}};
  for (const auto& arguments : wrong) {
    const EvalOutcome outcome = Cairn(arguments);
    EXPECT_EQ(outcome.code, ExitCode::kUsage) << ::testing::PrintToString(arguments);
    EXPECT_EQ(outcome.out, "");
    EXPECT_NE(outcome.err, "");
  }
}

}  // namespace
}  // namespace cairn::client
