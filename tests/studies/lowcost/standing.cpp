#include "tests/studies/lowcost/standing.h"

#include <algorithm>
#include <string>
#include <variant>

#include "client/sim/laser_models.h"
#include "client/sim/shipped_worlds.h"
#include "tests/studies/log_run.h"
#include "tests/studies/logs.h"

namespace cairn::studies {
namespace {

// A robot that stands for an hour is told to be no farther from where it is told to be on the whole.
constexpr double kMostM = 0.01;

// The drive before, which may be empty, and then the robot stands where it ended.
StudyLog ThenStanding(StudyLog log, const sim::Surroundings& surroundings, const sim::ModelledLaser& lidar,
                      double seconds, std::uint64_t seed) {
  Pose2 T_odom_robot;
  Stamp stamp = kNanosPerSecond;
  for (const LogRecord& record : log.records) {
    if (const auto* const odometry = std::get_if<Odometry>(&record)) T_odom_robot = odometry->T_odom_robot;
    stamp = std::visit([](const auto& value) { return value.stamp; }, record);
  }
  const Pose2 T_map_robot = PoseOn(log.truth, stamp, 1.0).value_or(log.T_map_robot_start);
  sim::Random random(seed);
  for (int k = 1; k <= static_cast<int>(seconds * lidar.scan_hz); ++k) {
    const Stamp now = stamp + StampFromSeconds(k / lidar.scan_hz);
    log.records.emplace_back(Odometry{0, now, T_odom_robot});
    log.records.emplace_back(sim::MeasureScan(*surroundings.scene, {}, T_map_robot, {}, now, 0.0, lidar.laser, random));
  }
  return log;
}

}  // namespace

void RunStanding(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Standing for an hour");
  report.Text(
      "From the start, how far the robot is told to be from there. After a drive of a minute, how far it is told to be "
      "from the middle of what it is told, from ten seconds after it stopped.");
  Table table({"lidar", "since", "scans", "farthest (mm)", "at the end (mm)", "turned at the end (mrad)"});
  const sim::Surroundings surroundings = sim::SurroundingsOf(*sim::OpenWorld("room"));
  for (const std::string model : {"rplidar-a1", "lds-01", "ld19"}) {
    for (const bool drives : {false, true}) {
      sim::FleetOptions robot;
      robot.robots = 1;
      robot.seed = context.seed;
      const sim::ModelledLaser lidar = *sim::WithModel(robot.laser, model);
      robot.laser = lidar.laser;
      robot.scan_hz = lidar.scan_hz;
      StudyLog log;
      if (drives) {
        log = SimulateLog("room", 60.0, robot);
      } else if (!surroundings.routes.empty()) {
        const Eigen::Vector2d& p_map = surroundings.routes.front().waypoints_map.front();
        log.T_map_robot_start = {p_map.x(), p_map.y(), 0.3};
      }
      const auto driven = log.scans();
      const double seconds = context.Pick(3600.0, 30.0);
      log = ThenStanding(std::move(log), surroundings, lidar, seconds, context.seed);
      slam::MapperOptions options;
      options.seed = static_cast<std::int64_t>(context.seed);
      const LogRun run = RunOverLog(log, options);
      const auto settled = driven == 0 ? std::size_t{0} : driven + static_cast<std::size_t>(10.0 * lidar.scan_hz);
      Eigen::Vector2d middle = log.T_map_robot_start.translation();
      if (drives) {
        middle.setZero();
        for (std::size_t k = settled; k < run.online.size(); ++k)
          middle += run.online[k].T_map_robot.translation() / static_cast<double>(run.online.size() - settled);
      }
      double farthest = 0.0;
      for (std::size_t k = settled; k < run.online.size(); ++k)
        farthest = std::max(farthest, (run.online[k].T_map_robot.translation() - middle).norm());
      const Pose2 last = run.online.back().T_map_robot;
      const double begun_rad = drives ? run.online[settled].T_map_robot.theta : log.T_map_robot_start.theta;
      table.Add({model, drives ? "it stopped" : "its start", Count(static_cast<long long>(run.online.size() - settled)),
                 Number(1e3 * farthest, 1), Number(1e3 * (last.translation() - middle).norm(), 1),
                 Number(1e3 * AngleDiff(last.theta, begun_rad), 1)});
      report.Expect(farthest <= kMostM, model + (drives ? ", after a drive" : "") +
                                            std::string(": a standing robot is told to move by more than 1 cm"));
    }
  }
  report.Add(table, "standing");
}

}  // namespace cairn::studies
