#include "server/slam/localisation/line_match.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/shipped_worlds.h"
#include "client/sim/world.h"
#include "server/slam/features/feature_extraction.h"
#include "server/slam/localisation/keyframe_lines.h"
#include "server/slam/localisation/place_hypotheses.h"
#include "server/slam/smoothing/smoothed_map.h"
#include "tests/studies/dpslam/grid_drive.h"
#include "tests/studies/log_run.h"
#include "tests/studies/mapper_choice.h"
#include "tests/studies/scene.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/thesis_b/known_map.h"
#include "tests/studies/thesis_b/thesis_b.h"

namespace cairn::studies {
namespace {

constexpr double kRightM = 0.2, kRightDeg = 5.0, kWrongM = 1.0;
constexpr double kReachM = 15.0;       // Of the map round a place that is known: what the laser sees of it.
constexpr std::size_t kLongest = 150;  // Lines of a log's map that are searched from nothing.

bool IsRight(const Pose2& answer, const Pose2& truth) {
  return (answer.translation() - truth.translation()).norm() < kRightM &&
         Degrees(std::abs(AngleDiff(answer.theta, truth.theta))) < kRightDeg;
}

std::vector<slam::LineFeature> LinesOf(const Scan& scan) {
  return slam::ExtractFeatures(scan, slam::FeatureOptions{}).lines;
}

// Counts over single scans, matched without any knowledge of the pose.
struct Placings {
  slam::LineMatchOptions options;
  int queries = 0, right = 0, wrong = 0, nowhere = 0, among = 0, alone = 0, alone_right = 0, bounded = 0;
  std::vector<double> hypotheses, cpu_ms;

  void Add(const std::vector<MapLine>& map, const Scan& scan, const Pose2& truth) {
    const auto lines = LinesOf(scan);
    const Stopwatch watch;
    const slam::LineMatchAnswer answer = slam::MatchLinesWithMap(map, lines, options);
    cpu_ms.push_back(watch.CpuMs());
    hypotheses.push_back(static_cast<double>(answer.hypotheses.size()));
    ++queries;
    bounded += answer.complete ? 0 : 1;
    if (answer.hypotheses.empty()) {
      ++nowhere;
      return;
    }
    const bool first = IsRight(answer.hypotheses.front().T_map_robot, truth);
    ++(first ? right : wrong);
    among += std::ranges::any_of(answer.hypotheses, [&](const auto& h) { return IsRight(h.T_map_robot, truth); });
    if (answer.complete && answer.hypotheses.size() == 1) ++alone, alone_right += first;
  }
  [[nodiscard]] std::string Share(int count) const { return Percent(1.0 * count / std::max(queries, 1)); }
  void AddTo(Table& table, const std::string& name, std::size_t map_lines) const {
    const Distribution t = DistributionOf(cpu_ms);
    table.Add({name, Count(static_cast<long long>(map_lines)), Count(queries), Share(right), Share(wrong),
               Share(nowhere), Share(among), Count(alone_right) + " of " + Count(alone),
               Number(DistributionOf(hypotheses).median, 0), Number(t.median, 1), Number(t.p95, 1), Share(bounded)});
  }
};

// The two ways to pair over the same scans.
struct BothPlacings {
  Placings ours, printed;

  BothPlacings() { printed.options.pairing = slam::LineMatchPairing::kRecursive; }
  void Add(const std::vector<MapLine>& map, const Scan& scan, const Pose2& truth) {
    ours.Add(map, scan, truth);
    printed.Add(map, scan, truth);
  }
  void AddTo(Table& table, const std::string& name, std::size_t map_lines) const {
    ours.AddTo(table, name, map_lines);
    printed.AddTo(table, name + ", as printed", map_lines);
  }
};

Table PlacingsTable() {
  return Table({"map", "lines", "scans", "right", "wrong", "not placed", "right among the answers", "only answer right",
                "answers median", "cpu median (ms)", "cpu p95 (ms)", "bound reached"});
}

using KnownMap = std::shared_ptr<const std::vector<MapLine>>;

struct Followed {
  Trajectory localized, odometry;           // Poses reported as localized; odometry from the true start.
  std::vector<double> error_m, odometry_m;  // Of all scans of the two, against the truth.
  std::vector<double> error_way_m, odometry_way_m;
  std::size_t scans = 0;        // With a truth.
  double placed_after_m = NAN;  // Distance travelled before the first pose reported as localized.
  Distribution cpu_ms;
};

// Runs the whole estimator with slam.filter=line_match over a log, without telling it the start pose.
Followed Follow(StudyContext& context, const StudyLog& log, const Trajectory& truth, const KnownMap& map) {
  auto options = MapperWith({"slam.filter=line_match"}, context.seed);
  if (!options) throw std::invalid_argument(options.error().message);
  options->filter.line_match.map = map;
  StudyLog lost = log;
  lost.T_map_robot_start = {50.0, -30.0, 2.0};  // An arbitrary wrong start pose.
  const LogRun run = RunOverLog(lost, *options);
  Followed followed;
  followed.cpu_ms = run.time_ms();
  std::optional<StampedPose> before;
  std::optional<Pose2> T_map_odometry;
  double way = 0.0;
  std::size_t next = 0;
  const std::vector<GridStep> steps = GridSteps(log, 0.0, 0.0);
  for (const GridStep& step : steps) {
    if (T_map_odometry) T_map_odometry = *T_map_odometry * step.T_prev_curr;
    const auto there = std::ranges::lower_bound(truth, step.stamp, {}, &StampedPose::stamp);
    if (there == truth.end() || there->stamp != step.stamp) continue;
    if (before) way += (there->T_map_robot.translation() - before->T_map_robot.translation()).norm();
    before = *there;
    if (!T_map_odometry) T_map_odometry = there->T_map_robot;
    const auto off = [&](const Pose2& T) { return (T.translation() - there->T_map_robot.translation()).norm(); };
    followed.odometry.push_back({step.stamp, *T_map_odometry});
    followed.odometry_m.push_back(off(*T_map_odometry));
    followed.odometry_way_m.push_back(way);
    while (next < run.online.size() && run.online[next].stamp < step.stamp) ++next;
    if (next == run.online.size() || run.online[next].stamp != step.stamp) continue;
    ++followed.scans;
    if (run.localized[next] == 0) continue;
    if (followed.localized.empty()) followed.placed_after_m = way;
    followed.localized.push_back(run.online[next]);
    followed.error_m.push_back(off(run.online[next].T_map_robot));
    followed.error_way_m.push_back(way);
  }
  return followed;
}

std::pair<StudyLog, StudyLog> Halves(const StudyLog& log) {
  StudyLog first = log, second = log;
  const auto middle = static_cast<std::ptrdiff_t>(log.records.size() / 2);
  first.records.erase(first.records.begin() + middle, first.records.end());
  second.records.erase(second.records.begin(), second.records.begin() + middle);
  return {first, second};
}

void AddFollowed(Table& table, const std::string& name, const Followed& run, std::size_t map_lines) {
  const Distribution error = DistributionOf(run.error_m), odometry = DistributionOf(run.odometry_m);
  const auto near = std::ranges::count_if(run.error_m, [](double m) { return m < kRightM; });
  const auto wrong = std::ranges::count_if(run.error_m, [](double m) { return m > kWrongM; });
  const double scans = std::max<double>(1.0, static_cast<double>(run.scans));
  table.Add({name, Count(static_cast<long long>(map_lines)),
             Number(run.odometry_way_m.empty() ? 0.0 : run.odometry_way_m.back(), 0), Number(run.placed_after_m, 1),
             Percent(static_cast<double>(run.error_m.size()) / scans), Percent(static_cast<double>(near) / scans),
             Percent(static_cast<double>(wrong) / scans), Number(error.median, 3), Number(error.p95, 2),
             Number(error.max, 2), Number(odometry.median, 2), Number(odometry.max, 2), Number(run.cpu_ms.mean, 2),
             Number(run.cpu_ms.p99, 1), Number(run.cpu_ms.max, 1)});
}

// A wrong pose that is reported as localized is worse than the report that the robot is lost. (Where all rooms look
// alike, "lost" is the right report.)
void ExpectHonest(Report& report, const std::string& name, const Followed& run) {
  const auto wrong = std::ranges::count_if(run.error_m, [](double m) { return m > kWrongM; });
  report.Expect(static_cast<double>(wrong) <= 0.01 * static_cast<double>(run.scans),
                name + ": reports a pose that is more than 1 m wrong as localized in " + Count(wrong) + " scans");
}

Table FollowedTable() {
  return Table({"drive", "map lines", "way (m)", "placed after (m)", "scans localized", "within 0.2 m", "over 1 m",
                "median (m)", "p95 (m)", "max (m)", "odometry median (m)", "odometry max (m)", "cpu a scan (ms)",
                "p99 (ms)", "max (ms)"});
}

Series WallSeries(const std::vector<MapLine>& map) {
  Series series{.label = "known map", .mark = Mark::kLine, .colour = 9};
  for (const MapLine& line : map) {
    series.x.insert(series.x.end(), {line.a.x(), line.b.x(), NAN});
    series.y.insert(series.y.end(), {line.a.y(), line.b.y(), NAN});
  }
  return series;
}

void DrawFollowed(Report& report, const std::string& name, const std::vector<MapLine>& map, const Trajectory& truth,
                  const Followed& run) {
  Plot paths{.title = name + ": localised in a known map of lines, from nothing",
             .x = {"x", "m"},
             .y = {"y", "m"},
             .equal_scale = true,
             .width = 1100,
             .height = 800};
  const auto line = [](Series series, Mark mark, int colour) {
    series.mark = mark;
    series.colour = colour;
    return series;
  };
  paths.series = {WallSeries(map), line(PathSeries(truth, "truth"), Mark::kLine, 2),
                  line(PathSeries(run.odometry, "odometry alone"), Mark::kDashed, 1),
                  line(PathSeries(run.localized, "localised"), Mark::kPoints, 5)};
  report.Add(paths, "line_match_" + name);
  Plot errors{.title = name + ": error over the way", .x = {"way", "m"}, .y = {"error", "m", true}};
  errors.series = {{.label = "odometry alone", .x = run.odometry_way_m, .y = run.odometry_m, .mark = Mark::kLine},
                   {.label = "localised", .x = run.error_way_m, .y = run.error_m, .mark = Mark::kLine}};
  report.Add(errors, "line_match_error_" + name);
}

// Evenly along all routes, facing along them.
std::vector<Pose2> PlacesAlong(const sim::World& world, int count) {
  double all = 0.0;
  for (const sim::Route& route : world.routes) all += sim::ClosedLength(route.waypoints_map);
  std::vector<Pose2> places;
  double way = 0.0;
  for (const sim::Route& route : world.routes) {
    const double length = sim::ClosedLength(route.waypoints_map);
    for (; way < length; way += all / count) {
      const sim::PathPlace place = sim::PlaceOnPath(route.waypoints_map, way);
      places.push_back({place.p_map.x(), place.p_map.y(), place.heading_rad});
    }
    way -= length;
  }
  return places;
}

void InSimulation(StudyContext& context, Table& placed, Table& followed) {
  Report& report = context.report;
  int right = 0, wrong = 0;
  for (const std::string& name : sim::ShippedWorldNames()) {
    report.Progress("LineMatch in " + name);
    const auto world = sim::OpenWorld(name);
    if (!world) throw std::invalid_argument(world.error().message);
    const std::vector<MapLine> map = KnownMapOf(*world);
    const Scene scene(name);
    sim::Random random(context.seed);
    BothPlacings placings;
    for (const Pose2& place : PlacesAlong(*world, context.Pick(80, 16)))
      placings.Add(map, scene.Look(place, Sick(0.01), random), place);
    placings.AddTo(placed, name, map.size());
    right += placings.ours.right;
    wrong += placings.ours.wrong;

    sim::FleetOptions fleet;
    fleet.seed = context.seed;
    fleet.scan_hz = 5.0;
    fleet.laser = Sick(0.01);
    const StudyLog log = SimulateLog(name, context.Pick(240.0, 60.0), fleet);
    const Followed run = Follow(context, log, log.truth, std::make_shared<const std::vector<MapLine>>(map));
    AddFollowed(followed, name, run, map.size());
    ExpectHonest(report, name, run);
    DrawFollowed(report, name, map, log.truth, run);
  }
  report.Expect(right >= wrong, "LineMatch gives more wrong than right places in the simulated worlds");
}

void OnLog(StudyContext& context, const StudyLog& log, Table& placed, Table& followed) {
  Report& report = context.report;
  report.Progress("LineMatch on " + log.name);
  const auto options = MapperWith({}, context.seed);
  if (!options) {
    report.Fault(options.error().message);
    return;
  }
  const LogRun run = RunOverLog(log, *options);
  const std::vector<Pose2> path = slam::SmoothedPath(run.snapshot);
  const Trajectory truth = run.snapshot.TrajectoryAlong(path);
  const std::vector<MapLine> map = slam::LinesOfKeyframes(run.snapshot.keyframes, path);
  const std::vector<MapLine> longest(map.begin(), map.begin() + static_cast<long>(std::min(kLongest, map.size())));

  std::vector<Stamp> in_the_map;
  for (const slam::Keyframe& keyframe : run.snapshot.keyframes) in_the_map.push_back(keyframe.scan->stamp);
  const std::vector<GridStep> steps = GridSteps(log, 0.0, 0.0);
  BothPlacings nothing_known, region_known;
  double region_lines = 0.0;
  std::size_t others = 0;
  for (const GridStep& step : steps) {
    if (std::ranges::binary_search(in_the_map, step.stamp)) continue;
    const auto there = std::ranges::lower_bound(truth, step.stamp, {}, &StampedPose::stamp);
    if (there == truth.end() || there->stamp != step.stamp || others++ % 50 != 0) continue;
    nothing_known.Add(longest, *step.scan, there->T_map_robot);
    const auto near = LinesNear(map, there->T_map_robot.translation(), kReachM);
    region_lines += static_cast<double>(near.size());
    region_known.Add(near, *step.scan, there->T_map_robot);
  }
  nothing_known.AddTo(placed, log.name + ", longest lines", longest.size());
  region_known.AddTo(placed, log.name + ", lines within 15 m",
                     static_cast<std::size_t>(region_lines / std::max(region_known.ours.queries, 1)));
  const Followed along = Follow(context, log, truth, std::make_shared<const std::vector<MapLine>>(map));
  AddFollowed(followed, log.name, along, map.size());
  // The map was made from the first half only, so it does not contain what only the second half shows.
  const auto [first, second] = Halves(log);
  const slam::MapperSnapshot earlier = RunOverLog(first, *options).snapshot;
  const auto map_before = slam::LinesOfKeyframes(earlier.keyframes, slam::SmoothedPath(earlier));
  AddFollowed(followed, log.name + ", second half in the map of the first",
              Follow(context, second, truth, std::make_shared<const std::vector<MapLine>>(map_before)),
              map_before.size());
  DrawFollowed(report, log.name, map, truth, along);
  ExpectHonest(report, log.name, along);
}

}  // namespace

void StudyLineMatch(StudyContext& context) {
  Report& report = context.report;
  report.Heading("LineMatch: the place in a known map of lines (2.2.2, Algorithm 1, (2.17)-(2.19))");
  report.Text(
      "The lines of single scans are matched with the lines of the map, without any knowledge of the "
      "pose. The answer that pairs the largest share of the scan is taken. *As printed* is Algorithm 1 "
      "(pairing=recursive), in which every line of the scan must be paired; the other rows are the "
      "default. An answer is right within 0.2 m and 5 deg. *Right among the answers* counts scans for "
      "which odometry could choose the right answer. In the simulated worlds the map consists of the "
      "walls, without posts and people, and the scans are taken along the robots' routes (180 deg, 1 "
      "cm of noise). For logs the map consists of the lines of all keyframes along the smoothed path "
      "of the whole log, with collinear lines merged; every 50th scan that is not a keyframe is "
      "matched, and the smoothed path is taken as the truth. The thesis prints no figures.");
  Table placed = PlacingsTable(), followed = FollowedTable();
  InSimulation(context, placed, followed);
  for (const StudyLog& log : ChooseLogs(context, {"mit-csail", "intel"}, context.Pick(0, 400)))
    OnLog(context, log, placed, followed);
  report.Add(placed, "line_match_placed");
  report.Text(
      "The whole estimator runs along a drive with slam.filter=line_match and is not given the start "
      "pose. It searches the whole map until one place is left, and then corrects the pose by (2.18) "
      "with the answer nearest to it, if that lies within a gate of 16.3. *Scans localized* is the "
      "share of all scans for which it reported a pose in the map as localized, and the errors are "
      "those of these scans. Odometry alone starts at the true pose.");
  report.Add(followed, "line_match_followed");
}

}  // namespace cairn::studies
