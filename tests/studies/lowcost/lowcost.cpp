// cairn-study lowcost: robots of today, with cheap lidars that turn slowly, see little and are noisy. Real logs beside
// raw odometry, the same drive at several rates, robots that stand, lidars by name, turns of several lengths, and a
// robot of which nobody knows anything.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>

#include "client/sim/laser_models.h"
#include "client/sim/shipped_worlds.h"
#include "server/tools/calibrate/laser_run.h"
#include "tests/server/tools/calibrate/handed_over_drive.h"
#include "tests/studies/lowcost/mapped.h"
#include "tests/studies/lowcost/standing.h"
#include "tests/studies/sensitivity/map_crispness.h"

namespace cairn::studies {
namespace {

// Where only odometry shows the way, the estimate must be as long.
constexpr double kMostShareOfWay = 0.02;
// The simulated drives, at whatever rate they are scanned. Over the seeds 1 to 3 it was 0.05 to 0.15 m; before
// odometry's noise counted by distance, up to 1.3 m at 40 scans a second.
constexpr double kMostErrorSmoothedM = 0.16;

// Every k-th scan such that `share` of them stay.
StudyLog Thinned(const StudyLog& log, double share) {
  StudyLog thinned = log;
  thinned.records.clear();
  double due = 1.0;
  for (const LogRecord& record : log.records) {
    if (std::holds_alternative<Scan>(record)) {
      if (due < 1.0) {
        due += share;
        continue;
      }
      due += share - 1.0;
    }
    thinned.records.push_back(record);
  }
  return thinned;
}

void RunRates(StudyContext& context) {
  Report& report = context.report;
  report.Heading("The same drive at several rates");
  report.Text("One drive, of which fewer scans are used. Errors are absolute trajectory errors.");
  Table table({"drive", "scans per second", "length by odometry (m)", "online (m)", "smoothed (m)", "error online (m)",
               "error smoothed (m)"});
  const auto add = [&](const StudyLog& log, double full_hz, std::initializer_list<double> rates) {
    for (const double hz : rates) {
      const StudyLog thinned = Thinned(log, std::min(1.0, hz / full_hz));
      const Mapped mapped = MapLog(context, thinned, {});
      const bool known = !log.truth.empty();
      const std::string which = log.name + ", " + Number(hz, 1) + " scans per second: ";
      const double odometry_m = LengthOf(RawPath(thinned));
      if (known) {
        report.Expect(TrajectoryError(mapped.smoothed, log.truth) <= kMostErrorSmoothedM,
                      which + "the smoothed error is too large");
      } else {
        for (const double length_m : {LengthOf(mapped.run.online), LengthOf(mapped.smoothed)})
          report.Expect(std::abs(length_m / odometry_m - 1.0) <= kMostShareOfWay,
                        which + "the corridor is not as long");
      }
      table.Add({log.name, Number(hz, 1), Number(odometry_m, 2), Number(LengthOf(mapped.run.online), 2),
                 Number(LengthOf(mapped.smoothed), 2),
                 known ? Number(TrajectoryError(mapped.run.online, log.truth), 3) : "",
                 known ? Number(TrajectoryError(mapped.smoothed, log.truth), 3) : ""});
    }
  };
  for (const std::string world : {"building", "corridor"}) {
    sim::FleetOptions robot;
    robot.seed = context.seed;
    robot.scan_hz = 40.0;
    robot.laser.field_of_view_rad = Radians(360.0);
    robot.laser.range_max_m = world == "corridor" ? 4.0 : 8.0;
    robot.laser.error.sigma_m = 0.02;
    robot.wheel_spread = {0.0, 0.0};
    add(SimulateLog(world, context.Pick(100.0, 15.0), robot), 40.0, {40.0, 25.0, 10.0, 5.0});
  }
  if (auto furo = OpenRealLog(context, "lowcost/furo_lsc_corridor-degene", 0, {0.04, StampAt::kMiddle, true, kPi}))
    add(*furo, 25.0, {25.0, 12.5, 8.3, 5.0});
  report.Add(table, "rates");
}

void RunLidars(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Lidars");
  Table table({"lidar", "odometry (m)", "online (m)", "smoothed (m)", "not localized (%)"});
  const auto add = [&](const std::string& name, const sim::FleetOptions& robot) {
    const StudyLog log = SimulateLog("office", context.Pick(150.0, 15.0), robot);
    const Mapped mapped = MapLog(context, log, {});
    table.Add({name, Number(TrajectoryError(RawPath(log), log.truth), 3),
               Number(TrajectoryError(mapped.run.online, log.truth), 3),
               Number(TrajectoryError(mapped.smoothed, log.truth), 3),
               Number(100.0 * static_cast<double>(mapped.run.not_localized) /
                          static_cast<double>(std::max<std::size_t>(1, mapped.run.online.size())),
                      1)});
  };
  const auto with = [&](const std::string& model) {
    sim::FleetOptions robot;
    robot.seed = context.seed;
    const sim::ModelledLaser lidar = *sim::WithModel(robot.laser, model);
    robot.laser = lidar.laser;
    robot.scan_hz = lidar.scan_hz;
    return robot;
  };
  for (const std::string model : {"rplidar-a1", "lds-01", "ld19", "xv11", "urg-04lx", "utm-30lx", "tim561"})
    add(model, with(model));
  sim::FleetOptions robot = with("rplidar-a1");
  robot.laser.error.bias_m = 0.03;
  add("rplidar-a1, ranges 3 cm too long", robot);
  robot = with("rplidar-a1");
  robot.laser.error.bias_share = 0.02;
  add("rplidar-a1, ranges 2 % too long", robot);
  for (const double sigma_m : {0.03, 0.06, 0.1}) {
    robot = with("rplidar-a1");
    robot.laser.error = {.sigma_m = sigma_m, .sigma_share = 0.0};
    add("rplidar-a1, " + Number(100.0 * sigma_m, 0) + " cm of noise", robot);
  }
  robot = with("rplidar-a1");
  robot.laser.dropout_share = 0.4;
  add("rplidar-a1, 40 % dropped", robot);
  robot = with("rplidar-a1");
  robot.laser.error.quantum_m = 0.05;
  add("rplidar-a1, ranges in steps of 5 cm", robot);
  robot = with("rplidar-a1");
  robot.laser.sweep_s *= (1.0 - 1.0 / 60.0) / (1.0 - 1.0 / 360.0);
  robot.laser.beams = 60;
  add("rplidar-a1, 60 beams", robot);
  report.Add(table, "lidars");
}

void RunRolling(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Lidars that turn slowly");
  report.Text(
      "The simulated building, five scans a second, 8 m of range, 20 mm of noise; a turn takes 0 to 0.2 s, which the "
      "scans say. Errors are absolute trajectory errors in m.");
  Table table({"a turn takes (s)", "seed", "odometry", "online", "smoothed"});
  for (const double turn_s : {0.0, 0.1, 0.2}) {
    for (std::uint64_t seed = 4; seed < 4 + context.Pick(3U, 1U); ++seed) {
      sim::FleetOptions robot;
      robot.seed = seed;
      robot.scan_hz = 5.0;
      robot.laser.field_of_view_rad = Radians(360.0);
      robot.laser.range_max_m = 8.0;
      robot.laser.error.sigma_m = 0.02;
      robot.laser.sweep_s = turn_s;
      const StudyLog log = SimulateLog("building", context.Pick(300.0, 30.0), robot);
      const Mapped mapped = MapLog(context, log, {});
      table.Add({Number(turn_s, 1), Count(static_cast<long long>(seed)),
                 Number(TrajectoryError(RawPath(log), log.truth), 3),
                 Number(TrajectoryError(mapped.run.online, log.truth), 3),
                 Number(TrajectoryError(mapped.smoothed, log.truth), 3)});
    }
  }
  report.Add(table, "rolling");
}

void RunUnknown(StudyContext& context) {
  Report& report = context.report;
  report.Heading("A robot that nobody knows");
  report.Text(
      "A turn takes 0.2 s, which the log does not say; its stamps are 0.15 s late. Then the same log with what "
      "`cairn-calibrate laser` finds. Errors are absolute trajectory errors in m, beside those of a lidar that "
      "measures at "
      "once.");
  server::test::HandedOverDrive drive;
  drive.world = "building";
  drive.seconds = context.Pick(300.0, 60.0);
  drive.robot.robots = 1;
  drive.robot.seed = context.seed;
  drive.robot.scan_hz = 5.0;
  drive.robot.laser.field_of_view_rad = Radians(360.0);
  drive.robot.laser.range_max_m = 8.0;
  drive.robot.laser.error.sigma_m = 0.02;
  drive.T_robot_laser_logged = drive.robot.laser.T_robot_laser;
  const StudyLog at_once = SimulateLog(drive.world, drive.seconds, drive.robot);
  drive.robot.laser.sweep_s = 0.2 * (1.0 - 1.0 / drive.robot.laser.beams);
  drive.lag_s = 0.15;
  const std::filesystem::path folder =
      report.directory().empty() ? std::filesystem::temp_directory_path() : report.directory();
  const std::filesystem::path path = folder / "unknown.log";
  std::ofstream file(path);
  server::test::WriteHandedOver(drive, file);
  file.close();
  server::LaserRunOptions run;
  run.log = path;
  run.threads = 1;
  const auto found = server::RunLaser(run);
  if (!found) return report.Fault(found.error().message);
  report.Text("```\n" + ReportText(*found) + "```");

  Table table({"lidar", "online (m)", "smoothed (m)", "blur of the smoothed map (mm)"});
  const auto add = [&](const std::string& name, const StudyLog& log, const slam::MapperOptions& options,
                       double late_s) {
    const Mapped mapped = MapLog(context, log, options);
    table.Add({name, Number(TrajectoryError(mapped.run.online, at_once.truth, late_s), 3),
               Number(TrajectoryError(mapped.smoothed, at_once.truth, late_s), 3),
               Number(1e3 * CrispnessOf(AllAtOnce(log, options.pairing), mapped.smoothed).blur_m, 1)});
    return TrajectoryError(mapped.smoothed, at_once.truth, late_s);
  };
  const double without = add("at once, no lag", at_once, {}, 0.0);
  auto untold = OpenLogFile(context, path);
  auto told = OpenLogFile(context, path, 0, found->fit.timing);
  if (!untold || !told) return;
  untold->T_map_robot_start = told->T_map_robot_start = at_once.T_map_robot_start;
  // The stamp of the last beam, or of the first one: what the truth is compared with.
  const double turn_s = drive.robot.laser.sweep_s;
  add("0.2 s a turn and 0.15 s late, not told", *untold, {}, 0.5 * turn_s + drive.lag_s);
  slam::MapperOptions measured;
  measured.pairing.laser_lag_s = found->fit.lag_s;
  measured.pairing.wheels = found->fit.mounting.wheels;
  const double with = add("the same, measured by cairn-calibrate laser", *told, measured, found->fit.lag_s);
  report.Add(table, "unknown");
  report.Text("Ratio of the smoothed errors: " + Number(with / without, 2) + " (at most 1.3 is wanted).");
  if (!(with <= 1.3 * without)) report.Warn("more than 1.3 times the error without lag and turn");
}

void RunLowcost(StudyContext& context) {
  if (context.Wants("logs")) RunLowcostLogs(context);
  if (context.Wants("alone")) RunScansAlone(context);
  if (context.Wants("rates")) RunRates(context);
  if (context.Wants("standing")) RunStanding(context);
  if (context.Wants("lidars")) RunLidars(context);
  if (context.Wants("glass")) RunGlass(context);
  if (context.Wants("rolling")) RunRolling(context);
  if (context.Wants("unknown")) RunUnknown(context);
  if (context.Wants("learning")) {
    RunLearning(context);
    RunLearnedHeadings(context);
  }
}

const Registration kRegistered{
    "lowcost", "robots of today: cheap lidars on real logs, rates, standing, lidars by name, robots nobody knows",
    RunLowcost};

}  // namespace
}  // namespace cairn::studies
