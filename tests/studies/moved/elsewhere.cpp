#include "tests/studies/moved/elsewhere.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/service/pose_report.h"
#include "server/slam/known_grid/known_grid.h"
#include "server/slam/scan/beam_points.h"
#include "server/slam/scan_pipeline.h"
#include "tests/server/slam/fleet_drives.h"

namespace cairn::studies {
namespace {

constexpr double kMappedS = 60.0;  // The carried robot has mapped for so long.
constexpr double kEveryS = 20.0;   // It is carried to where the third robot is, each time from the same state.
constexpr double kFollowedS = 90.0;
constexpr double kFirstJobS = 10.0;
// What the robot sees where it is carried to is another place if its own map knows at most the first of these shares of
// it, and the map of the site at least the second.
constexpr double kOwnShare = 0.2, kSiteShare = 0.5;
constexpr double kWrongPlaceM = 1.0;
constexpr double kDrawnEveryM = 0.25;

using test::FleetDrive;

slam::MapperOptions FewParticles(std::uint64_t seed) {
  slam::MapperOptions options;
  options.filter.particles = 20;
  options.seed = static_cast<std::int64_t>(seed);
  return options;
}

void Feed(slam::ScanPipeline& pipeline, LogRecord record, Stamp later, const Pose2& T_new_old) {
  if (auto* const scan = std::get_if<Scan>(&record)) {
    scan->stamp += later;
    scan->sequence = 0;
    return pipeline.Add(std::make_shared<const Scan>(std::move(*scan)));
  }
  auto& odometry = std::get<Odometry>(record);
  odometry.stamp += later;
  odometry.sequence = 0;
  odometry.T_odom_robot = T_new_old * odometry.T_odom_robot;
  pipeline.Add(odometry);
}

// What two robots have drawn, along their true ways: the map of the site after smoothing.
class SiteMap {
 public:
  explicit SiteMap(const slam::MapperOptions& options) : options_(options), grid_(options.grid) {}
  // All scans of the first `seconds`.
  void Draw(const FleetDrive& robot, double seconds) {
    std::optional<Pose2> last;
    for (const auto& [now, record] : robot.records) {
      const auto* const scan = std::get_if<Scan>(&record);
      if (scan == nullptr || now > seconds) continue;
      const auto truth = PoseOn(robot.truth, scan->stamp, 1.0);
      if (!truth || (last && (last->translation() - truth->translation()).norm() < kDrawnEveryM)) continue;
      last = truth;
      grid_.Draw(*scan, *truth);
    }
  }
  [[nodiscard]] std::shared_ptr<const slam::KnownGrid> Known() const {
    slam::KnownGrid::Tiles tiles;
    grid_.ForEachChunk([&](const slam::ChunkKey& key, const slam::GridChunk& chunk) {
      tiles.emplace(key, std::make_shared<const TileCells>(slam::OccupanciesOf(chunk)));
    });
    return std::make_shared<const slam::KnownGrid>(
        slam::KnownGrid::Source{std::move(tiles), options_.grid.resolution_m, 0}, options_.recovery.place,
        options_.self_check.near_m);
  }

 private:
  slam::MapperOptions options_;
  slam::OccupancyGrid grid_;
};

struct FollowedRobot {
  int jobs = 0, with_rival = 0, suggested = 0;
  int poses = 0, wrong = 0;
  double worst_m = 0.0;
  double found_after_m = -1.0;  // Way; it then stays localized.
};

// The robot before it is carried.
struct BeforeCarrying {
  std::string state;
  Pose2 T_odom_robot;
};

// `map`: that of the site; null: the robot has nothing but its own.
FollowedRobot FollowFrom(const BeforeCarrying& before, const FleetDrive& robot, double from_s,
                         const std::shared_ptr<const slam::KnownGrid>& map, const slam::MapperOptions& options) {
  FollowedRobot result;
  const Stamp later = StampFromSeconds(kMappedS + 1.0 - from_s);
  std::optional<Pose2> last;
  double way_m = 0.0;
  slam::ScanPipeline pipeline(options, {}, slam::SerialFor,
                              {.used =
                                   [&](const Scan& scan, const slam::ScanOutcome& outcome) {
                                     const auto truth = PoseOn(robot.truth, scan.stamp - later, 1.0);
                                     if (!truth) return;
                                     if (last) way_m += (truth->translation() - last->translation()).norm();
                                     last = truth;
                                     ++result.poses;
                                     if (!outcome.localized) {
                                       result.found_after_m = -1.0;
                                       return;
                                     }
                                     if (result.found_after_m < 0.0) result.found_after_m = way_m;
                                     const double error_m =
                                         (outcome.T_map_robot.translation() - truth->translation()).norm();
                                     result.worst_m = std::max(result.worst_m, error_m);
                                     result.wrong += error_m > kWrongPlaceM ? 1 : 0;
                                   },
                               .dropped = [](const Scan&, DropReason) {}});
  if (!pipeline.Load(before.state)) return result;
  slam::Mapper& mapper = pipeline.mapper();
  mapper.Relocalise(std::nullopt);
  slam::PlaceSearch search(options.recovery.place, options.loop, options.self_check, options.front_end.refine);
  std::optional<Pose2> T_new_old;
  double next_job_s = from_s + kFirstJobS, wait_s = kFirstJobS;
  for (const auto& [seconds, record] : robot.records) {
    if (seconds <= from_s || seconds > from_s + kFollowedS) continue;
    const auto* const odometry = std::get_if<Odometry>(&record);
    if (!T_new_old && odometry == nullptr) continue;
    if (!T_new_old) T_new_old = before.T_odom_robot * odometry->T_odom_robot.Inverse();
    Feed(pipeline, record, later, *T_new_old);
    if (map == nullptr || seconds < next_job_s) continue;
    const slam::Mapper::LostView view = mapper.SeenWhileLost();
    if (!view.lost || !view.since_lost) continue;
    const slam::RankedPlaces ranked = search.Rank(*map, view.scans, kMostHypotheses, [] { return true; });
    ++result.jobs;
    result.with_rival += ranked.ambiguity() >= options.loop.max_rival ? 1 : 0;
    if (ranked.found && mapper.SuggestPlace(view.scans.back().scan->stamp, ranked.found->T_map_robot, map))
      ++result.suggested;
    wait_s *= 2.0;
    next_job_s = seconds + wait_s;
  }
  pipeline.Finish();
  return result;
}

// The share of the hits of a scan at this pose that lie in what the map knows: a little before them it is not unknown.
double ShareKnown(const slam::KnownGrid& map, const Scan& scan, const Pose2& T_map_robot) {
  constexpr double kBeforeM = 0.1;
  int hits = 0, known = 0;
  for (const slam::BeamPoint& point : slam::PointsOf(scan)) {
    ++hits;
    known += map.At(T_map_robot * (point.p_robot - kBeforeM * point.p_robot.normalized())) != kUnknownCell ? 1 : 0;
  }
  return static_cast<double>(known) / std::max(1, hits);
}

struct ElsewhereTally {
  int cases = 0, found_alone = 0, found = 0, jobs = 0, with_rival = 0, suggested = 0, wrong = 0, poses = 0;
  double worst_m = 0.0;
  std::vector<double> way_m;

  void Add(const FollowedRobot& alone, const FollowedRobot& helped) {
    ++cases;
    found_alone += alone.found_after_m >= 0.0 ? 1 : 0;
    found += helped.found_after_m >= 0.0 ? 1 : 0;
    if (helped.found_after_m >= 0.0) way_m.push_back(helped.found_after_m);
    jobs += helped.jobs;
    with_rival += helped.with_rival;
    suggested += helped.suggested;
    wrong += helped.wrong;
    poses += helped.poses;
    worst_m = std::max(worst_m, helped.worst_m);
  }
};

void CarryThrough(const std::string& world, std::uint64_t seed, int moments, ElsewhereTally& tally) {
  const double until_s = kMappedS + kEveryS * moments + kFollowedS;
  // The first one is carried, the second one maps the site, and the third one drives where the first one is carried to:
  // its scans are in nobody's map.
  const std::vector<FleetDrive> robots = test::DriveFleet(world, 3, until_s, seed);
  const slam::MapperOptions options = FewParticles(seed);
  BeforeCarrying before;
  {
    slam::ScanPipeline mapping(
        options, robots[0].T_map_robot_start, slam::SerialFor,
        {.used = [](const Scan&, const slam::ScanOutcome&) {}, .dropped = [](const Scan&, DropReason) {}});
    for (const auto& [seconds, record] : robots[0].records) {
      if (seconds > kMappedS) break;
      if (const auto* const odometry = std::get_if<Odometry>(&record)) before.T_odom_robot = odometry->T_odom_robot;
      Feed(mapping, record, 0, {});
    }
    mapping.Save(before.state);
  }
  SiteMap site(options);
  site.Draw(robots[0], kMappedS);
  const auto own = site.Known();
  site.Draw(robots[1], until_s);
  const auto map = site.Known();
  for (int i = 0; i < moments; ++i) {
    const double from_s = kMappedS + kEveryS * (i + 1);
    const auto scan = std::ranges::find_if(robots[2].records, [&](const FleetDrive::Timed& one) {
      return one.seconds > from_s && std::holds_alternative<Scan>(one.record);
    });
    if (scan == robots[2].records.end()) break;
    const auto there = PoseOn(robots[2].truth, std::get<Scan>(scan->record).stamp, 1.0);
    const Scan& seen = std::get<Scan>(scan->record);
    if (!there || ShareKnown(*own, seen, *there) > kOwnShare || ShareKnown(*map, seen, *there) < kSiteShare) continue;
    tally.Add(FollowFrom(before, robots[2], from_s, nullptr, options),
              FollowFrom(before, robots[2], from_s, map, options));
  }
}

}  // namespace

void StudyElsewhere(StudyContext& context) {
  Table table({"world", "cases", "found alone", "found with jobs", "way p50 (m)", "jobs", "with a rival", "told",
               "poses", "wrong", "largest error (m)"});
  ElsewhereTally all;
  const int seeds = context.runs > 0 ? context.runs : context.Pick(10, 1);
  const std::vector<std::string> worlds = {"building", "office"};
  for (const std::string& world : worlds) {
    ElsewhereTally tally;
    for (int k = 0; k < seeds; ++k)
      CarryThrough(world, context.seed + static_cast<std::uint64_t>(k), context.Pick(6, 2), tally);
    std::ranges::sort(tally.way_m);
    const double cases = std::max(1, tally.cases);
    table.Add({world, Count(tally.cases), Percent(tally.found_alone / cases), Percent(tally.found / cases),
               tally.way_m.empty() ? "" : Number(tally.way_m[tally.way_m.size() / 2], 1), Count(tally.jobs),
               Count(tally.with_rival), Count(tally.suggested), Count(tally.poses), Count(tally.wrong),
               Number(tally.worst_m, 2)});
    all.cases += tally.cases;
    all.found += tally.found;
    all.found_alone += tally.found_alone;
    all.wrong += tally.wrong;
  }
  context.report.Add(table, "carried to another robot's part of the site");
  context.report.Expect(all.wrong == 0, "a robot was localized at a wrong place");
  context.report.Expect(all.cases == 0 || all.found > all.found_alone, "the search over the site found nobody");
}

}  // namespace cairn::studies
