// What the estimator learns of a robot's odometry while it drives (server/slam/tracking/odometry_learning.h): known
// errors of the wheels and a known lag are injected into simulated drives with a lidar that takes 0.2 s for a turn.
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "server/slam/scan/wheel_correction.h"
#include "tests/studies/lowcost/mapped.h"

namespace cairn::studies {
namespace {

struct Injected {
  std::string name;
  slam::WheelCorrection wheels;  // The true step for a step that odometry reports.
  double lag_s = 0.0;            // By which the stamps of scans are late.

  // As Mapper::learned.
  [[nodiscard]] std::vector<double> values() const {
    return {wheels.wheel_scale, wheels.turn_scale, wheels.turn_per_m, lag_s};
  }
};

StudyLog With(const StudyLog& log, const Injected& injected) {
  StudyLog wrong = log;
  std::optional<Pose2> before;
  Pose2 reported;
  const auto stamp_of = [](const LogRecord& record) {
    return std::visit([](const auto& one) { return one.stamp; }, record);
  };
  for (LogRecord& record : wrong.records) {
    if (auto* scan = std::get_if<Scan>(&record)) {
      scan->stamp += StampFromSeconds(injected.lag_s);
      continue;
    }
    auto& odometry = std::get<Odometry>(record);
    const Pose2 step = before ? Between(*before, odometry.T_odom_robot) : odometry.T_odom_robot;
    before = odometry.T_odom_robot;
    const slam::WheelCorrection& wheels = injected.wheels;
    const double way = step.x / wheels.wheel_scale;
    reported =
        reported * Pose2{way, step.y / wheels.wheel_scale, (step.theta - wheels.turn_per_m * way) / wheels.turn_scale};
    odometry.T_odom_robot = reported;
  }
  std::ranges::stable_sort(wrong.records, {}, stamp_of);
  return wrong;
}

}  // namespace

void RunLearning(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Learned while driving");
  report.Text(
      "One robot in `building`, 360 beams of 8 m with 2 cm of noise, 0.2 s a turn, 5 scans a second. Errors of its "
      "odometry and a lag of its lidar are injected; what is learned at the end, less what was injected. Errors of the "
      "path: mean over the seeds, aligned.");
  const std::vector<Injected> cases = {{"nothing", {}, 0.0},
                                       {"way 1 % too short", {1.01, 1.0, 0.0}, 0.0},
                                       {"way 3 % too short", {1.03, 1.0, 0.0}, 0.0},
                                       {"turn 2 % too small", {1.0, 1.02, 0.0}, 0.0},
                                       {"scans 0.15 s late", {}, 0.15},
                                       {"all of it", {1.02, 0.98, 0.01}, 0.15}};
  const int seeds = context.Pick(5, 1);
  std::vector<StudyLog> logs;
  for (int k = 0; k < seeds; ++k) {
    sim::FleetOptions robot;
    robot.scan_hz = 5.0;
    robot.laser.beams = 360;
    robot.laser.field_of_view_rad = 2.0 * kPi;
    robot.laser.range_max_m = 8.0;
    robot.laser.error.sigma_m = 0.02;
    robot.laser.sweep_s = 0.2 * (1.0 - 1.0 / robot.laser.beams);
    robot.wheel_spread = {0.0, 0.0};  // What is injected is all there is.
    robot.seed = context.seed + static_cast<std::uint64_t>(k);
    logs.push_back(SimulateLog("building", context.Pick(300.0, 100.0), robot));
  }
  Table table({"injected", "learning", "way (%)", "turn (%)", "turn (rad/m)", "lag (s)", "online (m)", "smoothed (m)"});
  // Bounds of the mean error of what is learned, in the order of Mapper::learned.
  const std::vector<double> bounds = {0.005, 0.01, 0.005, 0.01};
  double without = 0.0;
  for (const Injected& injected : cases) {
    for (const bool learning : {false, true}) {
      slam::MapperOptions options;
      options.learning.enabled = learning;
      std::vector<double> errors(bounds.size());
      double online = 0.0, smoothed = 0.0;
      for (const StudyLog& log : logs) {
        const Mapped mapped = MapLog(context, With(log, injected), options);
        online += TrajectoryError(mapped.run.online, log.truth, injected.lag_s) / seeds;
        smoothed += TrajectoryError(mapped.smoothed, log.truth, injected.lag_s) / seeds;
        for (std::size_t i = 0; i < mapped.run.learned.size(); ++i)
          errors[i] += std::abs(mapped.run.learned[i].value - injected.values()[i]) / seeds;
      }
      const auto cell = [&](std::size_t i, double factor, int decimals) {
        return learning ? Number(factor * errors[i], decimals) : std::string("-");
      };
      table.Add({injected.name, learning ? "on" : "off", cell(0, 100.0, 2), cell(1, 100.0, 2), cell(2, 1.0, 4),
                 cell(3, 1.0, 3), Number(online, 3), Number(smoothed, 4)});
      if (!learning) {
        if (injected.name == "nothing") without = smoothed;
        continue;
      }
      for (std::size_t i = 0; i < bounds.size(); ++i)
        report.Expect(errors[i] <= bounds[i] || context.quick, injected.name + ": not learned within its bound");
      if (!(smoothed <= 1.3 * without))
        report.Warn(injected.name + ": the smoothed error is more than 1.3 times that without injection");
    }
  }
  report.Add(table, "learning");
}

}  // namespace cairn::studies
