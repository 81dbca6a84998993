// cairn-offline as a process, over a simulated log: what it writes, what it prints, and that neither depends on the
// run.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/cli/program.h"
#include "common/sensor/carmen_writer.h"
#include "common/sensor/log_reader.h"
#include "common/sensor/trajectory.h"
#include "tests/child_process.h"
#include "tests/common/bag/bag_writer.h"
#include "tests/system/cli/simulated_log.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

class CairnOffline : public SimulatedLog<20> {
 protected:
  static std::string Log() { return LogFile().string(); }
  static ChildProcess::Outcome Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {CAIRN_OFFLINE_PATH, "--set", "slam.particles=30"});
    return ChildProcess(arguments).Wait();
  }
};

TEST_F(CairnOffline, SameInputAndSeedGiveTheSameBytesWhateverTheThreads) {
  const std::vector<std::string> names{"t.tum", "s.tum", "map.yaml", "map.png"};
  std::vector<std::string> first;
  for (const std::string threads : {"1", "1", "2", "5"}) {
    const TempDirectory out;
    const auto run = Run({Log(), "--threads", threads, "--trajectory", (out / "t.tum").string(), "--smooth",
                          "--smoothed-trajectory", (out / "s.tum").string(), "--map", (out / "map.yaml").string()});
    ASSERT_EQ(run.exit_code, 0) << run.output;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string bytes = out.Read(names[i]);
      ASSERT_FALSE(bytes.empty()) << names[i];
      if (first.size() < names.size()) {
        first.push_back(bytes);
      } else {
        EXPECT_TRUE(bytes == first[i]) << names[i] << " with " << threads << " threads";
      }
    }
    const auto online = ReadTum((out / "t.tum").string()), smoothed = ReadTum((out / "s.tum").string());
    ASSERT_TRUE(online && smoothed);
    EXPECT_EQ(online->size(), smoothed->size());
  }
}

// What the estimator knows at the end of the log: another pose for each scan than the one of its time, where the path
// has been corrected since; and it does not need a smoothing, nor does a smoothing change it.
TEST_F(CairnOffline, WritesThePathAsItIsKnownAtTheEndOfTheLog) {
  const TempDirectory out;
  const auto run =
      Run({Log(), "--trajectory", (out / "t.tum").string(), "--known-trajectory", (out / "k.tum").string()});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const auto online = ReadTum((out / "t.tum").string()), known = ReadTum((out / "k.tum").string());
  ASSERT_TRUE(online && known);
  ASSERT_EQ(known->size(), online->size());
  for (std::size_t i = 0; i < known->size(); ++i) {
    EXPECT_EQ((*known)[i].stamp, (*online)[i].stamp);
    EXPECT_LT(Between((*online)[i].T_map_robot, (*known)[i].T_map_robot).translation().norm(), 0.2);
  }
  const auto smoothing = Run({Log(), "--smooth", "--known-trajectory", (out / "again.tum").string()});
  ASSERT_EQ(smoothing.exit_code, 0) << smoothing.output;
  EXPECT_EQ(out.Read("again.tum"), out.Read("k.tum"));
  const auto two = Run({Log(), Log(), "--start", "0,0,0", "--start", "0,0,0", "--known-trajectory",
                        (out / "a.tum").string(), "--known-trajectory", (out / "b.tum").string()});
  ASSERT_EQ(two.exit_code, 0) << two.output;
  EXPECT_EQ(out.Read("a.tum"), out.Read("k.tum"));
  EXPECT_EQ(out.Read("b.tum"), out.Read("k.tum"));
}

// The drive of a log once more, as a bag and as a log. The angles of beams are rounded to floats, as a
// bag has them.
void WriteAgain(const std::string& drive, const std::filesystem::path& log, const std::filesystem::path& bag) {
  std::ofstream log_file(log);
  CarmenWriter writer(log_file);
  Pose2 T_odom_robot;
  std::vector<recorded::BagMessage> messages;
  const auto add = [&](const std::string& topic, const char* type, const std::string& bytes) {
    messages.push_back({topic, type, messages.size(), bytes});
  };
  const auto read = ReadLog(drive, {}, [&](LogRecord&& record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      T_odom_robot = odometry->T_odom_robot;
      writer.Write(*odometry);
      add("/odom", recorded::kOdometryType,
          recorded::CdrOf(ros2::Odometry{
              {odometry->stamp, "odom"}, "base", recorded::Link("", "", odometry->T_odom_robot).T_frame_child}));
      return true;
    }
    Scan& scan = std::get<Scan>(record);
    scan.angle_first_rad = static_cast<float>(scan.angle_first_rad);
    scan.angle_step_rad = static_cast<float>(scan.angle_step_rad);
    writer.Write(scan, T_odom_robot);
    if (messages.size() < 2) {
      ros2::Transforms mounting;
      mounting.transforms = {recorded::Link("base", "laser", scan.T_robot_laser)};
      add("/tf_static", recorded::kTransformType, recorded::CdrOf(mounting));
    }
    ros2::LaserScan message;
    message.header = {scan.stamp, "laser"};
    message.angle_min = scan.angle_first_rad;
    message.angle_increment = scan.angle_step_rad;
    message.range_min = scan.range_min_m;
    message.range_max = scan.range_max_m;
    message.ranges = scan.ranges_m;
    for (float& range : message.ranges)
      if (ClassifyRange(range, scan.range_min_m, scan.range_max_m) == BeamClass::kNoReturn)
        range = std::numeric_limits<float>::infinity();
    add("/scan", recorded::kScanType, recorded::CdrOf(message));
    return true;
  });
  ASSERT_TRUE(read) << read.error().message;
  std::ofstream(bag, std::ios::binary) << recorded::McapOf(messages, "zstd", 100);
}

TEST_F(CairnOffline, ABagGivesThePosesOfTheLog) {
  const TempDirectory out;
  WriteAgain(Log(), out / "drive.log", out / "drive.mcap");
  const auto from_log = Run({(out / "drive.log").string(), "--trajectory", (out / "log.tum").string()});
  const auto from_bag = Run({(out / "drive.mcap").string(), "--trajectory", (out / "bag.tum").string()});
  ASSERT_EQ(from_log.exit_code, 0) << from_log.output;
  ASSERT_EQ(from_bag.exit_code, 0) << from_bag.output;
  const auto log = ReadTum(out / "log.tum"), bag = ReadTum(out / "bag.tum");
  ASSERT_TRUE(log && bag);
  ASSERT_GT(log->size(), 100U);
  ASSERT_EQ(log->size(), bag->size());
  double farthest_m = 0.0;
  for (std::size_t i = 0; i < log->size(); ++i) {
    ASSERT_EQ((*log)[i].stamp, (*bag)[i].stamp);
    const Pose2 difference = (*log)[i].T_map_robot.Inverse() * (*bag)[i].T_map_robot;
    farthest_m = std::max(farthest_m, difference.translation().norm());
    if (i < 40) {
      EXPECT_LT(farthest_m, 1e-9) << i;
    }
  }
  // The headings of a bag's odometry are quaternions, and so differ in their last digit. Sooner or later the estimator
  // decides something otherwise for it, and the poses are apart by a part of its doubt.
  EXPECT_LT(farthest_m, 0.01);
}

// In the map of the same drive the robot is where it was, and nothing is mapped.
TEST_F(CairnOffline, ARobotIsOnlyLocalisedInAKnownMap) {
  const TempDirectory out;
  const std::string map = (out / "map.yaml").string();
  const auto mapped = Run({Log(), "--trajectory", (out / "mapped.tum").string(), "--map", map});
  ASSERT_EQ(mapped.exit_code, 0) << mapped.output;
  const auto localised =
      Run({Log(), "--known-map", map, "--start", "0,0,0", "--trajectory", (out / "localised.tum").string(), "--json"});
  ASSERT_EQ(localised.exit_code, 0) << localised.output;
  EXPECT_EQ(nlohmann::json::parse(localised.output)["keyframes"], 0);
  const auto path = ReadTum(out / "mapped.tum"), known = ReadTum(out / "localised.tum");
  ASSERT_TRUE(path && known);
  EXPECT_GT(known->size(), path->size() / 4);
  for (const StampedPose& pose : *known) {
    const auto same = std::ranges::find(*path, pose.stamp, &StampedPose::stamp);
    ASSERT_NE(same, path->end());
    EXPECT_LT((same->T_map_robot.translation() - pose.T_map_robot.translation()).norm(), 0.2) << pose.stamp;
  }
  EXPECT_EQ(Run({Log(), "--known-map", map, "--map", map}).exit_code, 2);
  EXPECT_EQ(Run({Log(), Log(), "--known-map", map}).exit_code, 2);
  const auto missing = Run({Log(), "--known-map", (out / "nowhere.yaml").string()});
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_NE(missing.output.find("nowhere.yaml"), std::string::npos) << missing.output;
}

// The same drive as two robots, the second of which is said to have started a little beside the first.
TEST_F(CairnOffline, SeveralRobotsAreSmoothedTogetherToTheSameBytesEveryTime) {
  const std::vector<std::string> names{"a.tum", "b.tum", "map.png"};
  std::vector<std::string> first;
  for (const std::string threads : {"1", "2"}) {
    const TempDirectory out;
    const auto run = Run({Log(), Log(), "--start", "0,0,0", "--start", "0.2,0.1,0", "--threads", threads, "--json",
                          "--smoothed-trajectory", (out / "a.tum").string(), "--smoothed-trajectory",
                          (out / "b.tum").string(), "--smoothed-map", (out / "map.yaml").string()});
    ASSERT_EQ(run.exit_code, 0) << run.output;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::string bytes = out.Read(names[i]);
      ASSERT_FALSE(bytes.empty()) << names[i];
      if (first.size() < names.size()) {
        first.push_back(bytes);
      } else {
        EXPECT_TRUE(bytes == first[i]) << names[i] << " with " << threads << " threads";
      }
    }
    const auto robots = nlohmann::json::parse(run.output)["robots"];
    ASSERT_EQ(robots.size(), 2U);
    for (const auto& robot : robots) {
      EXPECT_TRUE(robot["joined"]);
      EXPECT_TRUE(robot["in_map"]);
      EXPECT_EQ(robot["frame"], 0);
      EXPECT_GT(robot["scans_used"], 100);
      EXPECT_GT(robot["agreement"], 0.95);
    }
    const auto a = ReadTum(out / "a.tum"), b = ReadTum(out / "b.tum");
    ASSERT_TRUE(a && b);
    EXPECT_LT((a->back().T_map_robot.translation() - b->back().T_map_robot.translation()).norm(), 0.05);
  }
}

// What 20 s of driving show is no proof of where a robot is.
TEST_F(CairnOffline, ARobotThatIsNotJoinedIsNotDrawnIntoTheOthersMap) {
  const TempDirectory out;
  const auto run = Run({Log(), Log(), "--start", "0,0,0", "--start", "unknown", "--smooth"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  EXPECT_NE(run.output.find("not joined"), std::string::npos) << run.output;
  EXPECT_NE(run.output.find("not drawn"), std::string::npos) << run.output;
}

TEST_F(CairnOffline, SaysWhichOptionsEachOfSeveralLogsNeeds) {
  EXPECT_EQ(Run({Log(), Log(), "--start", "0,0,0"}).exit_code, 2);
  EXPECT_EQ(Run({Log(), Log(), "--smoothed-trajectory", "a.tum"}).exit_code, 2);
  EXPECT_EQ(Run({Log(), Log(), "--known-trajectory", "a.tum"}).exit_code, 2);
  EXPECT_EQ(Run({Log(), Log(), "--map", "map.yaml"}).exit_code, 2);
  EXPECT_EQ(Run({Log(), "--start", "somewhere"}).exit_code, 2);
}

TEST_F(CairnOffline, FindsItselfInTheWallsOfAnEarlierDriveFromAWrongStart) {
  const TempDirectory out;
  const std::string lines = (out / "walls.lines").string();
  ASSERT_EQ(Run({Log(), "--trajectory", (out / "before.tum").string(), "--map-lines", lines}).exit_code, 0);
  const auto run = Run({Log(), "--set", "slam.filter=line_match", "--set", "slam.line_match.map=" + lines, "--start",
                        "50,-30,90deg", "--trajectory", (out / "found.tum").string(), "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const auto before = ReadTum(out / "before.tum"), found = ReadTum(out / "found.tum");
  ASSERT_TRUE(before && found);
  ASSERT_EQ(before->size(), found->size());
  EXPECT_GT((found->front().T_map_robot.translation() - before->front().T_map_robot.translation()).norm(), 10.0);
  EXPECT_LT((found->back().T_map_robot.translation() - before->back().T_map_robot.translation()).norm(), 0.1);
  const auto report = nlohmann::json::parse(run.output);
  EXPECT_GT(report["not_localized"], 0);
  EXPECT_LT(report["not_localized"], report["scans_used"]);
}

TEST_F(CairnOffline, PrintsOneObjectForMachines) {
  const auto run = Run({Log(), "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const auto report = nlohmann::json::parse(run.output);
  for (const char* key : {"time_ms_mean", "time_ms_p50", "time_ms_p99", "time_ms_max", "cpu_s", "wall_s", "scans_used",
                          "scans_dropped", "landmarks", "peak_rss_mib"})
    EXPECT_TRUE(report.contains(key)) << key;
  EXPECT_GT(report["scans_used"], 100);
  EXPECT_EQ(report["scans_dropped"], 0);
  EXPECT_LE(report["time_ms_p50"], report["time_ms_p99"]);
}

TEST_F(CairnOffline, SaysWhereTheTimeOfAScanWent) {
  const auto run = Run({Log(), "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const auto report = nlohmann::json::parse(run.output);
  const auto sum_of = [&](const char* steps) {
    double sum_ms = 0.0;
    for (const auto& [name, ms] : report[steps].items()) sum_ms += ms.get<double>();
    return sum_ms;
  };
  EXPECT_NEAR(sum_of("step_ms_mean"), report["cpu_ms_mean"].get<double>(), 1e-6);
  EXPECT_NEAR(sum_of("step_ms_in_slowest_scan"), report["cpu_ms_max"].get<double>(), 1e-6);
  EXPECT_LE(report["cpu_ms_mean"], report["cpu_ms_max"]);
  for (const char* step : {"look", "match", "refine", "filter", "draw"})
    EXPECT_GT(report["step_ms_mean"][step], 0.0) << step;
  EXPECT_LT(report["step_ms_mean"]["recover"], report["step_ms_mean"]["refine"]) << "nobody carried this robot";
}

TEST_F(CairnOffline, StartsWhereItIsTold) {
  const TempDirectory out;
  const auto first = [&](const std::string& start) {
    const std::string path = (out / "t.tum").string();
    const auto run = Run({Log(), "--trajectory", path, "--start", start});
    EXPECT_EQ(run.exit_code, 0) << run.output;
    const auto trajectory = ReadTum(path);
    return trajectory && !trajectory->empty() ? trajectory->front().T_map_robot : Pose2{};
  };
  const Pose2 radians = first("-1.5,2,1.5707963267948966"), degrees = first("-1.5,2,90deg");
  EXPECT_NEAR(radians.x, -1.5, 0.1);
  EXPECT_NEAR(radians.y, 2.0, 0.1);
  EXPECT_NEAR(AngleDiff(radians.theta, Radians(90)), 0.0, 0.05);
  EXPECT_EQ(degrees, radians);
  for (const std::string bad : {"1,2", "1,2,x", "nan,0,0", "1e7,0,0", "0,0,90grad"}) {
    const auto run = Run({Log(), "--start", bad});
    EXPECT_EQ(run.exit_code, 2) << bad;
    EXPECT_NE(run.output.find("'" + bad + "'"), std::string::npos) << run.output;
  }
}

TEST_F(CairnOffline, SaysWhatIsWrongAndExitsByIt) {
  const auto missing = Run({"/nowhere/at-all.log"});
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_NE(missing.output.find("at-all.log"), std::string::npos) << missing.output;
  const std::string json = Run({"/nowhere/at-all.log", "--json"}).output;
  const auto error = nlohmann::json::parse(json.substr(0, json.find('\n')))["error"];
  EXPECT_EQ(error["code"], "NOT_FOUND") << json;
  EXPECT_NE(error["message"].get<std::string>().find("at-all.log"), std::string::npos) << json;
  EXPECT_EQ(Run({}).exit_code, 2);
  EXPECT_EQ(Run({Log(), "--no-such-option"}).exit_code, 2);
  const auto range = Run({Log(), "--set", "slam.grid.resolution_m=5"});
  EXPECT_NE(range.exit_code, 0);
  EXPECT_NE(range.output.find("resolution_m"), std::string::npos) << range.output;
  const auto contradiction = Run({Log(), "--set", "slam.grid.no_return_free_m=26"});
  EXPECT_EQ(contradiction.exit_code, 2);
  EXPECT_EQ(contradiction.output,
            "cairn-offline: slam.grid.no_return_free_m (26) must not exceed slam.grid.max_ray_m (25)\n");
}

}  // namespace
}  // namespace cairn::client
