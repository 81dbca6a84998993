#include <filesystem>
#include <optional>

#include "server/tools/calibrate/laser_run.h"
#include "tests/real_log_path.h"
#include "tests/studies/lowcost/mapped.h"
#include "tests/studies/sensitivity/map_crispness.h"

namespace cairn::studies {
namespace {

// What the description of the logs says of the lidars.
struct RealRobot {
  std::string log;
  LidarTiming timing;
};
std::vector<RealRobot> RealRobots() {
  const auto turns = [](double period_s, std::optional<bool> clockwise, std::optional<double> from_rad) {
    return LidarTiming{period_s, StampAt::kMiddle, clockwise, from_rad};
  };
  return {{"maebot_rplidara1_convex", turns(0.147, true, 0.0)},
          {"turtlebot4_rplidara1_mac2", turns(0.13, true, 0.0)},
          {"neato_xv11_middle", turns(0.2, {}, {})},
          {"mines_urg04lx_exp1", turns(0.1, {}, {})},
          {"lego_urg04lx_robot4", turns(0.1, {}, {})},
          {"furo_lsc_corridor-degene", turns(0.04, true, kPi)},
          {"slambot_rplidara1_6AUG14_16m", turns(0.182, true, 0.0)}};
}

// The log without its odometry, or with odometry that stands where it was at the start.
StudyLog WithoutOdometry(StudyLog log) {
  std::erase_if(log.records, [](const LogRecord& record) { return std::holds_alternative<Odometry>(record); });
  return log;
}
StudyLog WithStandingOdometry(StudyLog log) {
  for (LogRecord& record : log.records)
    if (auto* odometry = std::get_if<Odometry>(&record)) odometry->T_odom_robot = {};
  return log;
}

}  // namespace

void RunScansAlone(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Without odometry");
  report.Text(
      "The same logs without their odometry, and with odometry that stands, beside those with it; no option is set. "
      "The scans by which paths are judged are moved by the true odometry. A corridor longer than the lidar sees comes "
      "out too short.");
  Table table(
      {"log", "odometry", "scans used", "not localized", "blur (mm)", "thickness (mm)", "smoothed (mm)", "length (m)"});
  for (const RealRobot& robot : RealRobots()) {
    const auto log = OpenRealLog(context, "lowcost/" + robot.log, context.Pick(0, 150), robot.timing);
    if (!log) continue;
    const StudyLog still = AllAtOnce(*log);
    const auto add = [&](const char* odometry, const StudyLog& given) {
      const Mapped mapped = MapLog(context, given, {});
      const MapCrispness online = CrispnessOf(still, mapped.run.online);
      table.Add({robot.log, odometry, Count(static_cast<long long>(mapped.run.online.size())),
                 Count(static_cast<long long>(mapped.run.not_localized)), Number(1e3 * online.blur_m, 1),
                 Number(1e3 * online.thickness_m, 1), Number(1e3 * CrispnessOf(still, mapped.smoothed).thickness_m, 1),
                 Number(LengthOf(mapped.run.online), 2)});
      return mapped.run.online.size();
    };
    const std::size_t with = add("used", *log);
    if (add("none", WithoutOdometry(*log)) < with) report.Warn(robot.log + ": scans are lost without odometry");
    add("stands", WithStandingOdometry(*log));
  }
  report.Add(table, "alone");
}

void RunLowcostLogs(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Real logs");
  report.Text(
      "Raw odometry, the estimator online, and smoothed. First with what the description of the log says of the lidar, "
      "then with what `cairn-calibrate laser` finds in the log, whose scans, moved by its own motion, are another "
      "yardstick.");
  Table table({"log", "lidar", "path", "blur (mm)", "thickness (mm)", "length (m)", "position error (m)"});
  for (const RealRobot& robot : RealRobots()) {
    const std::filesystem::path path = RealLog("lowcost/" + robot.log + ".log");
    for (const bool calibrated : {false, true}) {
      LidarTiming timing = robot.timing;
      slam::MapperOptions options;
      std::optional<Pose2> T_robot_laser;
      if (calibrated) {
        if (!std::filesystem::exists(path)) continue;
        server::LaserRunOptions run;
        run.log = path;
        run.threads = 1;
        const auto found = server::RunLaser(run);
        if (!found) {
          report.Warn(found.error().message);
          continue;
        }
        report.Text("`" + robot.log + "`:\n```\n" + ReportText(*found) + "```");
        timing = found->fit.timing;
        T_robot_laser = found->fit.mounting.T_robot_laser;
        options.pairing.laser_lag_s = found->fit.lag_s;
        options.pairing.wheels = found->fit.mounting.wheels;
      }
      auto log = OpenRealLog(context, "lowcost/" + robot.log, context.Pick(0, 150), timing);
      if (!log) continue;
      for (LogRecord& record : log->records) {
        if (auto* scan = std::get_if<Scan>(&record); scan != nullptr && T_robot_laser)
          scan->T_robot_laser = *T_robot_laser;
      }
      const StudyLog still = AllAtOnce(*log, options.pairing);
      const Mapped mapped = MapLog(context, *log, options);
      Trajectory positions;
      if (auto read = ReadTum(RealLog("lowcost/" + robot.log + "_positions.tum"))) positions = *std::move(read);
      const Trajectory raw = RawPath(*log);
      std::vector<MapCrispness> crispness;
      for (const auto& [name, one] : {std::pair{"odometry", &raw}, std::pair{"online", &mapped.run.online},
                                      std::pair{"smoothed", &mapped.smoothed}}) {
        crispness.push_back(CrispnessOf(still, *one));
        table.Add({robot.log, calibrated ? "measured" : "as described", name, Number(1e3 * crispness.back().blur_m, 1),
                   Number(1e3 * crispness.back().thickness_m, 1), Number(LengthOf(*one), 2),
                   positions.empty() ? "" : Number(TrajectoryError(*one, positions, 0.0, true), 4)});
      }
      const auto not_worse = [&](std::size_t a, std::size_t b) {
        return crispness[a].blur_m <= 1.02 * crispness[b].blur_m;
      };
      const std::string which = robot.log + (calibrated ? ", measured" : ", as described");
      if (!not_worse(1, 0)) report.Warn(which + ": less crisp online than raw odometry");
      if (!not_worse(2, 1)) report.Warn(which + ": less crisp smoothed than online");
      Plot plot{.title = which, .x = {"x", "m"}, .y = {"y", "m"}};
      plot.series = {PathSeries(mapped.smoothed, "smoothed")};
      report.AddMap(mapped.map, plot, robot.log + (calibrated ? " measured" : ""));
    }
  }
  report.Add(table, "logs");
}

}  // namespace cairn::studies
