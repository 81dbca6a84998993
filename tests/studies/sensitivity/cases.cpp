#include "tests/studies/sensitivity/cases.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "server/slam/smoothing/smoothed_map.h"
#include "tests/studies/log_run.h"
#include "tests/studies/sensitivity/map_crispness.h"

namespace cairn::studies {
namespace {

// Mean distance of positions at equal stamps.
double MeanDistance(const Trajectory& trajectory, const Trajectory& truth) {
  double sum = 0.0;
  std::size_t count = 0;
  auto at = truth.begin();
  for (const StampedPose& pose : trajectory) {
    while (at != truth.end() && at->stamp < pose.stamp) ++at;
    if (at == truth.end()) break;
    if (at->stamp != pose.stamp) continue;
    sum += (pose.T_map_robot.translation() - at->T_map_robot.translation()).norm();
    ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
}

// Odometry at the scans' stamps, starting where the robot starts.
Trajectory OdometryAt(const LogRun& run, const StudyLog& log) {
  Trajectory path;
  std::optional<Pose2> T_odom_start;
  for (std::size_t i = 0; i < run.snapshot.scans.size(); ++i) {
    const auto after = std::find_if(log.records.begin(), log.records.end(), [&](const LogRecord& record) {
      const auto* odometry = std::get_if<Odometry>(&record);
      return odometry != nullptr && odometry->stamp >= run.snapshot.scans[i].stamp;
    });
    if (after == log.records.end()) break;
    const Pose2 T_odom_robot = std::get<Odometry>(*after).T_odom_robot;
    if (!T_odom_start) T_odom_start = T_odom_robot;
    path.push_back({run.snapshot.scans[i].stamp, log.T_map_robot_start * Between(*T_odom_start, T_odom_robot)});
  }
  return path;
}

// The answer of the server. If places were seen again, the fitted path is the answer whatever the grids
// contain, so drawing them can be left out.
Trajectory SmoothedOf(const slam::MapperSnapshot& snapshot, const slam::GridOptions& grid) {
  if (!snapshot.relations.empty()) return snapshot.TrajectoryAlong(slam::SmoothedPath(snapshot));
  const auto map = slam::SmoothMap(snapshot, grid, [] { return true; });
  return snapshot.TrajectoryAlong(map->path);
}

struct Drive {
  std::string world;
  double seconds = 0.0;
  sim::FleetOptions robot;
};

// Four different robots: the simulator's default, one whose wheels slip, one with a range of 8 m, one with a
// cheap lidar.
std::vector<Drive> SimulatedDrives(std::uint64_t seed) {
  sim::FleetOptions usual;
  usual.seed = seed;
  sim::FleetOptions slipping = usual;
  slipping.wheels.slip_m_per_sqrt_m = 0.02;
  slipping.wheel_spread.wheel_share = 0.015;
  sim::FleetOptions short_sighted = usual;
  short_sighted.laser.range_max_m = 8.0;
  sim::FleetOptions cheap = usual;
  cheap.scan_hz = 5.5;
  cheap.laser.field_of_view_rad = Radians(360.0);
  cheap.laser.range_max_m = 6.0;
  cheap.laser.error.sigma_m = 0.02;
  return {{"building", 100.0, usual},
          {"office", 120.0, slipping},
          {"corridor", 60.0, short_sighted},
          {"room", 60.0, cheap}};
}

void AddRealLog(StudyContext& context, const std::string& name, Case like, std::vector<Case>& cases, int max_scans = 0,
                const LidarTiming& timing = {}) {
  auto log = OpenRealLog(context, name, max_scans, timing);
  if (!log) return;
  like.name = max_scans > 0 ? log->name + " (first " + Count(max_scans) + " scans)" : log->name;
  like.log = *std::move(log);
  cases.push_back(std::move(like));
}

void AddDrive(const StudyContext& context, const Drive& drive, Case like, std::vector<Case>& cases) {
  like.yardstick = Yardstick::kTruth;
  like.group = "simulated";
  like.log = SimulateLog(drive.world, context.quick ? 20.0 : drive.seconds, drive.robot);
  like.name = like.log.name;
  cases.push_back(std::move(like));
}

// The first 4500 scans of mit-killian close three large loops; all of it takes four times as long.
void AddKillian(StudyContext& context, Case like, std::vector<Case>& cases) {
  like.group = "mit-killian";
  AddRealLog(context, "mit-killian", std::move(like), cases, context.Pick(4500, 300));
}

// The quickest cases come first, so that a study that is stopped early has run all constants on them.
void AddUsualCases(StudyContext& context, const Case& like, std::vector<Case>& cases) {
  Case one = like;
  one.group = "mit-csail";
  AddRealLog(context, "mit-csail", one, cases, context.Pick(0, 300));
  one.group = "small robots";
  one.yardstick = Yardstick::kOdometry;
  AddRealLog(context, "lowcost/furo_lsc_corridor-degene", one, cases, context.Pick(0, 100));
  one.yardstick = Yardstick::kCrispness;
  const std::array<const char*, 5> quick = {"duke-loop5", "lowcost/lego_urg04lx_robot4", "lowcost/mines_urg04lx_exp1",
                                            "lowcost/neato_xv11_middle", "lowcost/turtlebot4_rplidara1_mac2"};
  for (const char* name : quick) AddRealLog(context, name, one, cases, context.Pick(0, 50));
  for (const Drive& drive : SimulatedDrives(context.seed)) AddDrive(context, drive, like, cases);
  if (context.quick) return;
  AddRealLog(context, "lowcost/maebot_rplidara1_convex", one, cases);
  AddRealLog(context, "lowcost/slambot_rplidara1_6AUG14_16m", one, cases);
  one = like;
  one.group = "intel";
  AddRealLog(context, "intel", one, cases);
  AddKillian(context, like, cases);
}

// Lidars that turn slowly, and what is known of how they turn.
void AddRollingCases(StudyContext& context, const Case& like, std::vector<Case>& cases) {
  Case one = like;
  one.group = "small robots";
  one.yardstick = Yardstick::kCrispness;
  const auto turns = [](double scan_period_s, bool clockwise) {
    return LidarTiming{scan_period_s, StampAt::kMiddle, clockwise, 0.0};
  };
  AddRealLog(context, "lowcost/maebot_rplidara1_convex", one, cases, context.Pick(0, 50), turns(0.147, true));
  AddRealLog(context, "lowcost/turtlebot4_rplidara1_mac2", one, cases, context.Pick(0, 50), turns(0.13, true));
  AddRealLog(context, "lowcost/slambot_rplidara1_6AUG14_16m", one, cases, context.Pick(0, 50), turns(0.182, true));
  for (Drive& drive : SimulatedDrives(context.seed)) {
    drive.robot.laser.sweep_s = 0.9 / drive.robot.scan_hz;
    AddDrive(context, drive, like, cases);
    cases.back().name += ", rolling";
  }
}

// The scans from which the estimator draws its map, with the motion of the robot taken out of them.
StudyLog DrawnScans(const slam::MapperSnapshot& snapshot) {
  StudyLog log;
  for (const slam::Keyframe& keyframe : snapshot.keyframes) log.records.emplace_back(*keyframe.scan);
  return log;
}

}  // namespace

std::vector<Case> CasesOf(StudyContext& context, Runs runs) {
  Case like;
  like.runs = runs;
  like.options.seed = static_cast<std::int64_t>(context.seed);
  // The default method reads no grid, and drawing takes time.
  like.options.grid.max_ray_m = like.options.grid.resolution_m;
  std::vector<Case> cases;
  switch (runs) {
    case Runs::kUsual:
    case Runs::kSelfCheck:
      AddUsualCases(context, like, cases);
      break;
    case Runs::kLoops: {
      Drive ring = SimulatedDrives(context.seed)[1];
      ring.seconds = 250.0;
      AddDrive(context, ring, like, cases);
      cases.back().name += ", once round";
      if (context.quick)
        AddKillian(context, like, cases);
      else
        AddUsualCases(context, like, cases);
      break;
    }
    case Runs::kRolling:
      AddRollingCases(context, like, cases);
      break;
    case Runs::kMoved:  // Cases of their own: the study `moved`.
      break;
    case Runs::kDpSlam:
      like.options.filter.kind = slam::FilterKind::kDpSlam;
      like.options.filter.particles = 40;
      like.group = "mit-csail";
      AddRealLog(context, "mit-csail", like, cases, context.Pick(600, 100));
      break;
    case Runs::kNdtAlone:
      like.options.matcher = slam::MatcherKind::kNdt;
      like.options.front_end.refine_enabled = false;
      like.options.front_end.use_odometry = false;
      like.group = "mit-csail";
      AddRealLog(context, "mit-csail", like, cases, context.Pick(600, 100));
      like.group = "small robots";
      like.yardstick = Yardstick::kCrispness;
      AddRealLog(context, "duke-loop5", like, cases, context.Pick(0, 100));
      break;
  }
  return cases;
}

Figures MeasureRun(const Case& one, const slam::MapperOptions& options) {
  const LogRun run = RunOverLog(one.log, options);
  const Trajectory smoothed = SmoothedOf(run.snapshot, slam::GridOptions{});
  Figures figures;
  switch (one.yardstick) {
    case Yardstick::kRelations:
      figures = {{"online", ErrorOf(run.online, one.log.relations).trans_mean_m},
                 {"smoothed", ErrorOf(smoothed, one.log.relations).trans_mean_m}};
      break;
    case Yardstick::kTruth:
      figures = {{"online", MeanDistance(run.online, one.log.truth)},
                 {"smoothed", MeanDistance(smoothed, one.log.truth)}};
      break;
    case Yardstick::kOdometry: {
      const Trajectory odometry = OdometryAt(run, one.log);
      figures = {{"online", MeanDistance(run.online, odometry)}, {"smoothed", MeanDistance(smoothed, odometry)}};
      break;
    }
    case Yardstick::kCrispness: {
      // In scans as they were measured, the motion of the robot blurs walls whatever their poses are.
      const bool rolling = one.runs == Runs::kRolling;
      const StudyLog drawn = rolling ? DrawnScans(run.snapshot) : StudyLog{};
      const StudyLog& scans = rolling ? drawn : one.log;
      const MapCrispness online = CrispnessOf(scans, run.online), after = CrispnessOf(scans, smoothed);
      figures = {{"online blur", online.blur_m},
                 {"online thickness", online.thickness_m},
                 {"smoothed blur", after.blur_m},
                 {"smoothed thickness", after.thickness_m}};
      break;
    }
  }
  figures.emplace_back("not localized",
                       static_cast<double>(run.not_localized) / std::max(1.0, static_cast<double>(run.online.size())));
  return figures;
}

}  // namespace cairn::studies
