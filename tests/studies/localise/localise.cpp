// cairn-study localise: one half of a drive, only localised in the map of the other. How much of it is localised, is
// any pose wrong, how exact are they, and how long does it take to find the robot, of which nothing is known at first?
// In simulated places also a drive in a map that is out of date. The reference is the smoothed path of the whole drive,
// with simulated drives the truth. It is moved to the map at each place, by the nearest pose of the drive that made the
// map: that map has errors of its own, of up to a metre at opposite ends of mit-killian, and a robot that is localised
// in it must be right relative to what it shows. "Inside" are the scans of which at least half of the points lie where
// the map shows a wall if they are placed so.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "server/slam/known_grid/known_grid.h"
#include "server/slam/scan/beam_points.h"
#include "server/slam/scan_pipeline.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/server/slam/known_grid_of.h"
#include "tests/studies/log_run.h"
#include "tests/studies/logs.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

constexpr double kWrongM = 0.5;
constexpr double kWrongRad = 0.2;

// The path of a drive in the reference, and in the map that was made of it: poses of the same stamps.
class MadeMap {
 public:
  MadeMap(const Trajectory& reference, const Trajectory& in_map) {
    for (const StampedPose& pose : in_map) {
      const auto there = PoseOn(reference, pose.stamp, 0.01);
      if (there) poses_.emplace_back(*there, pose.T_map_robot);
    }
  }
  // Where a pose of the reference lies in the map: by the nearest pose first, then by all that are not much farther
  // away. Where the map shows a place twice, because a loop of its drive is not closed, they differ, and each is right.
  [[nodiscard]] std::vector<Pose2> InMap(const Pose2& T_reference_robot) const {
    constexpr double kAlsoWithinM = 2.0;
    const auto away_m = [&](const auto& pose) {
      return (pose.first.translation() - T_reference_robot.translation()).norm();
    };
    const auto nearest = std::ranges::min_element(poses_, {}, away_m);
    if (nearest == poses_.end()) throw std::invalid_argument("the reference does not show the drive of the map");
    std::vector<Pose2> all = {nearest->second * Between(nearest->first, T_reference_robot)};
    for (const auto& pose : poses_) {
      if (away_m(pose) < away_m(*nearest) + kAlsoWithinM)
        all.push_back(pose.second * Between(pose.first, T_reference_robot));
    }
    return all;
  }

 private:
  std::vector<std::pair<Pose2, Pose2>> poses_;
};

StudyLog Part(const StudyLog& log, double from, double to) {
  StudyLog part{
      .name = log.name, .records = {}, .relations = {}, .truth = {}, .T_map_robot_start = log.T_map_robot_start};
  const auto begin = static_cast<std::ptrdiff_t>(from * static_cast<double>(log.records.size()));
  const auto end = static_cast<std::ptrdiff_t>(to * static_cast<double>(log.records.size()));
  part.records.assign(log.records.begin() + begin, log.records.begin() + end);
  return part;
}

Trajectory SmoothedTrajectory(const slam::MapperSnapshot& snapshot) {
  return snapshot.TrajectoryAlong(slam::SmoothedPath(snapshot));
}

std::shared_ptr<const slam::KnownGrid> MapOf(const slam::MapperSnapshot& snapshot, const slam::MapperOptions& options) {
  slam::OccupancyGrid grid(options.grid);
  const std::vector<Pose2> path = slam::SmoothedPath(snapshot);
  for (std::size_t k = 0; k < path.size(); ++k) grid.Draw(*snapshot.keyframes[k].scan, path[k]);
  return slam::test::KnownGridOf(grid, options);
}

bool IsInside(const slam::KnownGrid& map, const Scan& scan, const Pose2& T_map_robot) {
  int points = 0, shown = 0;
  for (const slam::BeamPoint& point : slam::PointsOf(scan)) {
    ++points;
    shown += map.surfaces().Nearest(T_map_robot * point.p_robot, 0.2) != nullptr ? 1 : 0;
  }
  return points > 0 && 2 * shown >= points;
}

struct Outcome {
  long long inside = 0;            // Scans inside, after the robot was found.
  long long inside_localized = 0;  // ... and localised.
  long long outside_localized = 0;
  long long wrong = 0;
  double squares_m2 = 0.0;
  long long compared = 0;
  double worst_m = 0.0;
  double way_to_found_m = -1.0;
  double way_inside_m = 0.0;  // The part of it inside.
  std::vector<double> scan_ms;
};

Outcome LocaliseIn(const std::shared_ptr<const slam::KnownGrid>& map, const StudyLog& log, const Trajectory& reference,
                   const MadeMap& made, const slam::MapperOptions& options) {
  Outcome result;
  Stopwatch watch;
  double way_m = 0.0;
  std::optional<Pose2> last;
  slam::ScanPipeline pipeline(options, {}, slam::SerialFor,
                              {.used =
                                   [&](const Scan& scan, const slam::ScanOutcome& outcome) {
                                     result.scan_ms.push_back(watch.CpuMs());
                                     watch.Restart();
                                     const auto there = PoseOn(reference, scan.stamp, 0.5);
                                     if (!there) return;
                                     const std::vector<Pose2> truths = made.InMap(*there);
                                     const bool inside = IsInside(*map, scan, truths.front());
                                     const double step_m =
                                         last ? (there->translation() - last->translation()).norm() : 0.0;
                                     last = there;
                                     way_m += step_m;
                                     if (outcome.localized && result.way_to_found_m < 0.0)
                                       result.way_to_found_m = way_m;
                                     if (inside && result.way_to_found_m < 0.0) result.way_inside_m += step_m;
                                     if (result.way_to_found_m < 0.0) return;
                                     result.inside += inside ? 1 : 0;
                                     if (!outcome.localized) return;
                                     (inside ? result.inside_localized : result.outside_localized) += 1;
                                     double error_m = std::numeric_limits<double>::infinity();
                                     bool wrong = true;
                                     for (const Pose2& truth : truths) {
                                       const Pose2 error = Between(truth, outcome.T_map_robot);
                                       const double by_m = error.translation().norm();
                                       error_m = std::min(error_m, by_m);
                                       wrong = wrong && (by_m > kWrongM || std::abs(error.theta) > kWrongRad);
                                     }
                                     result.wrong += wrong ? 1 : 0;
                                     result.squares_m2 += error_m * error_m;
                                     ++result.compared;
                                     result.worst_m = std::max(result.worst_m, error_m);
                                   },
                               .dropped = [](const Scan&, DropReason) {}});
  static_cast<void>(pipeline.mapper().LocaliseIn(map, false));
  for (const LogRecord& record : log.records) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      if (ValidateOdometry(*odometry)) pipeline.Add(*odometry);
      continue;
    }
    auto scan = std::make_shared<const Scan>(std::get<Scan>(record));
    watch.Restart();
    if (ValidateScan(*scan)) pipeline.Add(std::move(scan));
  }
  pipeline.Finish();
  return result;
}

// A robot is localised with `second` in the map that was made with `first`.
struct Drives {
  std::string name;
  StudyLog first, second;
  Trajectory reference;  // Of both.
};

Drives Swapped(const Drives& drives) {
  return {drives.name + ", the first half in the second", drives.second, drives.first, drives.reference};
}

Drives HalvesOf(const StudyLog& log, const slam::MapperOptions& options) {
  return {log.name, Part(log, 0.0, 0.5), Part(log, 0.5, 1.0),
          log.truth.empty() ? SmoothedTrajectory(RunOverLog(log, options).snapshot) : log.truth};
}

// Another drive, after all furniture was moved.
Drives AfterMoving(const std::string& world, double seconds, std::uint64_t seed) {
  constexpr int kPieces = 40;
  sim::FleetOptions fleet;
  fleet.seed = seed;
  fleet.furniture = {.pieces = kPieces, .seed = seed};
  Drives drives{"simulated " + world + ", furniture moved", SimulateLog(world, seconds, fleet), {}, {}};
  fleet.seed = seed + 1;
  fleet.furniture.seed = seed + 1;
  fleet.first_stamp += StampFromSeconds(seconds + 60.0);
  drives.second = SimulateLog(world, seconds, fleet);
  drives.reference = drives.first.truth;
  drives.reference.insert(drives.reference.end(), drives.second.truth.begin(), drives.second.truth.end());
  return drives;
}

void StudyLocalise(StudyContext& context) {
  Report& report = context.report;
  report.Heading("A drive in the map of an earlier one");
  slam::MapperOptions options;
  options.seed = static_cast<std::int64_t>(context.seed);
  std::vector<Drives> all;
  for (const StudyLog& log : ChooseLogs(context, {"intel", "mit-csail", "mit-killian"})) {
    if (!context.Wants(log.name)) continue;
    all.push_back(HalvesOf(log, options));
    all.push_back(Swapped(all.back()));
  }
  for (const char* const world : {"office", "building", "storey"}) {
    if (!context.logs.empty() || !context.Wants(world)) continue;
    sim::FleetOptions fleet;
    fleet.seed = context.seed;
    const double seconds = context.Pick(1200.0, 300.0);
    all.push_back(HalvesOf(SimulateLog(world, seconds, fleet), options));
    all.push_back(AfterMoving(world, 0.5 * seconds, context.seed));
  }
  Table table({"log", "way until found (m)", "inside of it", "scans inside", "localised", "localised outside", "wrong",
               "error rms (m)", "largest (m)", "mean (ms)", "p99 (ms)", "longest (ms)"});
  for (const auto& [name, first_drive, second_drive, reference] : all) {
    const LogRun first = RunOverLog(first_drive, options);
    const auto map = MapOf(first.snapshot, options);
    const MadeMap made(reference, SmoothedTrajectory(first.snapshot));
    const Outcome outcome = LocaliseIn(map, second_drive, reference, made, options);
    const Distribution ms = DistributionOf(outcome.scan_ms);
    const double share =
        static_cast<double>(outcome.inside_localized) / std::max(1.0, static_cast<double>(outcome.inside));
    table.Add({name, Number(outcome.way_to_found_m, 1), Number(outcome.way_inside_m, 1), Count(outcome.inside),
               Number(100.0 * share, 1) + " %", Count(outcome.outside_localized), Count(outcome.wrong),
               Number(std::sqrt(outcome.squares_m2 / std::max(1.0, static_cast<double>(outcome.compared))), 3),
               Number(outcome.worst_m, 2), Number(ms.mean, 2), Number(ms.p99, 1), Number(ms.max, 1)});
    report.Expect(outcome.wrong == 0, name + ": " + Count(outcome.wrong) + " poses are localized at a wrong place");
    // In mit-killian the robot comes back along corridors that look alike (server/slam/README.md).
    const double least = name.find("killian") == std::string::npos ? 0.95 : 0.9;
    report.Expect(share >= least, name + ": " + Number(100.0 * share, 1) + " % of what is inside is localized");
  }
  report.Add(table, "localise");
}

const Registration kLocalise("localise", "a drive, only localised in the map of an earlier one", StudyLocalise);

}  // namespace
}  // namespace cairn::studies
